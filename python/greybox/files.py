"""Files of measured signals: MATLAB, NumPy, Parquet, Arrow, MDF4."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from greybox.align import Method, align
from greybox.checks import names as names_of
from greybox.checks import path as path_of
from greybox.errors import Error
from greybox.signals import near

__all__ = ["TEXT", "read"]

#: Endings of text files with columns, which the compiled library reads by itself.
TEXT = (".csv", ".tsv", ".txt", ".dat")


def read(
    path: str | os.PathLike[str],
    /,
    *,
    signals: Iterable[str] | None = None,
    method: Method | Mapping[str, Method] | None = None,
    step: float | None = None,
) -> Any:
    """Read the signals of a file, as a frame for :func:`greybox.fit`.

    ================================== ================================================================================
    ``.parquet``, ``.pq``              Parquet, by pyarrow or else polars
    ``.arrow``, ``.feather``, ``.ipc`` Arrow, by pyarrow or else polars
    ``.npz``, ``.npy``                 NumPy: arrays by name, or one structured array
    ``.mat``                           MATLAB: vectors by name, columns of a matrix as ``y_1``, ``y_2``, fields as ``log.speed``, or ``speed``
                                       where one structure is all there is; by SciPy, of version 7.3 by h5py
    ``.mf4``, ``.mdf``                 measurement logs by asammdf, whose signals may have rates of their own
    ================================== ================================================================================

    Text files with columns (``.csv``) need no reading: ``gb.fit(model, "drive.csv", ...)``, in which separator, decimal comma, dates and
    a row of units are found.

    Parameters
    ----------
    path : path
        The file.
    signals : names, optional
        Which signals; all without it.
    method, step
        Of signals with rates of their own, as in :func:`greybox.align`.

    Returns
    -------
    frame
        A table of pyarrow or polars, or a dict of arrays by name.

    Raises
    ------
    Error
        If the file cannot be read, has no such signal, or the package that reads it is not installed.
    """
    path = Path(path_of("path", path))
    names = None if signals is None else names_of("signals", signals)
    reader = _READERS.get(path.suffix.lower())
    if path.suffix.lower() in TEXT:
        raise Error(f"{path}: hand the path over in place of a frame, gb.fit(model, {str(path)!r}, ...); or read it by pandas.read_csv")
    if reader is None:
        raise Error(f"{path}: files that end in `{path.suffix}` are not known; known are {', '.join([*_READERS, *TEXT])}")
    if not path.is_file():
        raise Error(f"{path}: there is no such file")
    if path.stat().st_size == 0:
        raise Error(f"{path}: the file is empty")
    if reader is not _mdf and (method is not None or step is not None):
        raise Error(f"{path}: method and step are for signals with rates of their own, which files `{path.suffix}` do not have; see gb.align")
    try:
        found = _mdf(path, names, method, step) if reader is _mdf else reader(path, names)
    except (Error, ImportError, MemoryError):
        raise
    except Exception as error:
        raise Error(f"{path} cannot be read as `{path.suffix}`: {str(error).strip() or type(error).__name__}") from error
    return found


def _needed(path: Path, what: str) -> Error:
    return Error(f"{path} is read by {what}, which is not installed: pip install {what}")


def _chosen(path: Path, found: dict[str, Any], names: list[str] | None) -> dict[str, Any]:
    if not found:
        raise Error(f"{path}: there are no signals (columns of numbers) in the file")
    if names is None:
        return found
    for name in names:
        if name not in found:
            raise Error(f"{path}: there is no signal `{name}`; the file has: {near(name, found)}")
    return {name: found[name] for name in names}


def _table(path: Path, names: list[str] | None, pyarrows: Callable[[], Any], polars: Callable[[Any], Any]) -> Any:
    try:
        table = pyarrows()
    except ImportError:
        try:
            import polars as library
        except ImportError:
            raise _needed(path, "pyarrow") from None
        table = polars(library)
    found = list(getattr(table, "column_names", None) or table.columns)
    return table if names is None else table.select(list(_chosen(path, dict.fromkeys(found), names)))


def _parquet(path: Path, names: list[str] | None) -> Any:
    def pyarrows() -> Any:
        from pyarrow import parquet

        # The file alone: a path that looks like `key=value` adds no column.
        with path.open("rb") as file:
            return parquet.read_table(file)

    return _table(path, names, pyarrows, lambda library: library.read_parquet(path))


def _arrow(path: Path, names: list[str] | None) -> Any:
    def pyarrows() -> Any:
        from pyarrow import feather

        return feather.read_table(path, memory_map=False)

    return _table(path, names, pyarrows, lambda library: library.read_ipc(path, memory_map=False))


def _npz(path: Path, names: list[str] | None) -> dict[str, Any]:
    with np.load(path, allow_pickle=False) as arrays:
        return _chosen(path, dict(_columns((name, arrays[name]) for name in arrays.files)), names)


def _npy(path: Path, names: list[str] | None) -> dict[str, Any]:
    array = np.load(path, allow_pickle=False)
    if array.dtype.names is None:
        raise Error(f"{path}: one array of the shape {array.shape} has no names; make a frame: dict(zip(['t', ...], np.load(path).T))")
    return _chosen(path, {name: array[name] for name in array.dtype.names}, names)


def _mat(path: Path, names: list[str] | None) -> dict[str, Any]:
    with path.open("rb") as file:
        head = file.read(520)
    hdf5 = b"\x89HDF\r\n\x1a\n" in (head[:8], head[512:520])
    variables = _matlab_hdf5(path) if hdf5 else _matlab(path)
    found = dict(_columns(variables.items()))
    structures = {name: dict(_columns(one.items())) for name, one in variables.items() if isinstance(one, dict)}
    if not found and len(structures) == 1:
        # One structure, as a logger writes it: its fields are the signals.
        (found,) = structures.values()
    else:
        found |= {f"{name}.{field}": value for name, fields in structures.items() for field, value in fields.items()}
    if not found:
        kinds = ", ".join(f"{name} ({_kind(one)})" for name, one in variables.items()) or "nothing"
        raise Error(
            f"{path}: there are no vectors of numbers in the file, but {kinds}. In MATLAB: "
            "s = table2struct(T, 'ToScalar', true); save('record.mat', '-struct', 's')"
        )
    return _chosen(path, found, names)


def _kind(value: Any) -> str:
    return "structure" if isinstance(value, dict) else type(value).__name__


def _matlab(path: Path) -> dict[str, Any]:
    try:
        from scipy.io import loadmat
    except ImportError:
        raise _needed(path, "scipy") from None
    return {name: value for name, value in loadmat(path, simplify_cells=True).items() if not name.startswith("__")}


def _matlab_hdf5(path: Path) -> dict[str, Any]:
    try:
        import h5py
    except ImportError:
        raise _needed(path, "h5py") from None

    def values(group: Any) -> Iterator[tuple[str, Any]]:
        for name, item in group.items():
            if name.startswith("#"):
                continue
            if isinstance(item, h5py.Group):
                yield name, dict(values(item))
            elif item.attrs.get("MATLAB_class", b"double") in _NUMBERS and not item.attrs.get("MATLAB_empty", 0):
                # MATLAB's order of rows and columns is the reverse.
                yield name, item[()].T

    with h5py.File(path, "r") as file:
        return dict(values(file))


_NUMBERS = (
    b"double", b"single", b"logical", b"int8", b"int16", b"int32", b"int64", b"uint8", b"uint16", b"uint32", b"uint64",
)  # fmt: skip


def _columns(arrays: Iterable[tuple[str, Any]]) -> Iterator[tuple[str, Any]]:
    """Give the vectors of numbers or dates among arrays, and the columns of matrices; a number by itself is no signal."""
    for name, value in arrays:
        if not isinstance(value, np.ndarray) or value.dtype.kind not in "fiubmM":
            continue
        if value.ndim == 2 and 1 in value.shape:
            value = value.ravel()
        if value.ndim == 1 and value.size > 1:
            yield name, value
        elif value.ndim == 2 and len(value) > 1:
            yield from ((f"{name}_{k + 1}", np.ascontiguousarray(column)) for k, column in enumerate(value.T))


def _mdf(
    path: Path, names: list[str] | None, method: Method | Mapping[str, Method] | None = None, step: float | None = None
) -> dict[str, Any]:
    try:
        import asammdf
    except ImportError:
        raise _needed(path, "asammdf") from None
    with asammdf.MDF(path) as log:
        masters = {group.channels[0].name for group in log.groups if group.channels}
        there = [name for name in log.channels_db if name not in masters]
        for name in names or []:
            if name not in there:
                raise Error(f"{path}: there is no signal `{name}`; the file has: {near(name, there)}")
            if len(log.channels_db[name]) > 1:
                raise Error(f"{path}: there are {len(log.channels_db[name])} signals `{name}`; keep one of them (asammdf's MDF.filter)")
        chosen = names if names is not None else [name for name in there if len(log.channels_db[name]) == 1]
        signals = {one.name: (one.timestamps, one.samples) for one in log.select(chosen, validate=True)}
    if names is None:
        signals = {name: (t, values) for name, (t, values) in signals.items() if values.dtype.kind in "fiub" and values.ndim == 1 and len(t)}
    if not signals:
        raise Error(f"{path}: there are no signals (columns of numbers) in the file")
    return align(signals, method=method, step=step)


_READERS: dict[str, Callable[..., Any]] = {
    ".parquet": _parquet,
    ".pq": _parquet,
    ".arrow": _arrow,
    ".feather": _arrow,
    ".ipc": _arrow,
    ".npz": _npz,
    ".npy": _npy,
    ".mat": _mat,
    ".mf4": _mdf,
    ".mdf": _mdf,
}
