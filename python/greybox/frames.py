"""Frames: measured columns from pandas, polars, Arrow or arrays, and results as the caller's kind of frame."""

from __future__ import annotations

import mmap
import re
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from typing import Any, TypeAlias

import numpy as np

from greybox import _core
from greybox.checks import column_name, mapping, number
from greybox.errors import Error, RecordWarning, in_python, warn
from greybox.signals import near

__all__ = [
    "INDEX", "Array", "Frame", "Kind", "has_times", "is_readonly", "joined", "named_columns", "place", "positive_time", "rename", "seconds", "steps",
    "time_column",
]  # fmt: skip

Array: TypeAlias = "np.ndarray[Any, np.dtype[np.float64]]"

#: Makes a frame of columns, of the kind that the caller handed over.
Kind: TypeAlias = Callable[[Mapping[str, Any]], Any]

#: The part of a sample time by which times of a column may differ from it, as rounded ones do.
_SAME = 0.01

#: Units of numbers that count from 1970.
_SINCE_1970 = {1e-3: "milliseconds", 1e-6: "microseconds", 1e-9: "nanoseconds"}

#: How files and tables of Arrow call the index of a pandas frame that has no name.
INDEX = "__index_level_0__"

_TIMES = ("t", "time", "Time", "TIME", "timestamp", "Timestamp")


class Frame:
    """One measured record: columns by name, of any kind of frame."""

    def __init__(self, data: Any) -> None:
        if isinstance(data, Frame):
            # Opened once: a stream cannot be read again.
            self.__dict__.update(data.__dict__)
            return
        self._arrays: Mapping[Any, Any] | None = None
        self._frame: Any = None
        if isinstance(data, np.ndarray) and data.dtype.names is not None:
            self._arrays = {name: data[name] for name in data.dtype.names}
        elif isinstance(data, Mapping):
            self._arrays = data
        else:
            self._frame = _narwhals(data)
        # Of an xarray dataset, coordinates are columns, too.
        names = self._frame.columns if self._arrays is None else [*self._arrays, *getattr(self._arrays, "coords", ())]
        #: What the frame calls its columns, also by numbers, by their names as text.
        self._called = _called(names)
        #: The index of a pandas frame, where it says more than the rows' numbers.
        self.index = _index(data)

    @property
    def names(self) -> list[str]:
        """Names of the columns."""
        return list(self._called)

    @property
    def kind(self) -> Kind:
        """What makes a frame of the same kind."""
        if self._frame is None:
            return dict
        import narwhals as nw

        return Native(str(nw.get_native_namespace(self._frame).__name__))

    def __contains__(self, name: str) -> bool:
        return name in self.names

    def column(self, name: str, signal: str, unit: str) -> Array:
        """Give the column of a signal of this unit as floating-point numbers; what is missing is NaN.

        Raises
        ------
        Error
            If there is no such column, it has another unit, or no numbers.
        """
        found = place(self.names, name, signal, unit)
        if found is None:
            renamed = f" for `{signal}`" if signal != name else ""
            hint = f'; name another by columns={{"{signal}": "..."}}'
            raise Error(f"there is no column `{name}`{renamed}; the frame has: {near(name, self.names)}{hint}")
        if self._arrays is None:
            return _numbers(self._frame.get_column(self._called[found]), found)
        return _array_numbers(self._arrays[self._called[found]], found)

    def values(self, name: str) -> Any:
        """Give a column as it is."""
        if self._arrays is not None:
            return _entries(self._arrays[self._called[name]], name)
        column = self._frame.get_column(self._called[name])
        if column.dtype.is_integer() and column.null_count():
            # As floating-point numbers large ones would be rounded.
            return np.array(column.to_list(), dtype=object)
        return np.asarray(column.to_numpy())

    def rows(self, name: str, rows: Any) -> Any:
        """Give some rows of a column as the frame has it, with its zone where it has one."""
        if self._arrays is not None:
            return self.values(name)[rows]
        import narwhals as nw

        # The index of pandas has the places of the rows in the frame.
        return nw.maybe_reset_index(self._frame.get_column(self._called[name])[rows]).to_native()

    def time(self, name: str | None, sample_time: float | None, rows: int, signals: Collection[str] = ()) -> Array:
        """Give the time of each row in seconds; of dates, since the first. Columns of `signals` are the time only where `name` says so.

        Raises
        ------
        Error
            If there is no time, it is neither numbers nor dates, dates do not increase, or a column says another time than `sample_time`.
        """
        if sample_time is None:
            return seconds(*self.stamps(name, signals))
        beside = self.beside(signals)
        return steps(sample_time, rows, None if beside is None else (seconds(*beside), beside[1]))

    def beside(self, signals: Collection[str]) -> tuple[Any, str] | None:
        """Give the time of a column that is no signal's, beside a sample time."""
        found = time_column([one for one in self.names if one not in signals])
        return None if found is None else self.stamps(found)

    def _stored_index(self) -> str | None:
        """Give the column of a table that is an index of pandas without a name, unless it counts the rows."""
        if self._frame is None or INDEX not in self or self._frame.get_column(INDEX).dtype.is_integer():
            return None
        return INDEX

    def stamps(self, name: str | None, signals: Collection[str] = ()) -> tuple[Any, str]:
        """Give the time of each row as it stands, in seconds or as a duration in nanoseconds, and where it stands.

        Raises
        ------
        Error
            If there is none, or it is neither numbers nor dates. What is missing is refused by :func:`seconds`.
        """
        index = None if getattr(self.index, "name", None) is None else str(self.index.name)
        found = time_column([one for one in self.names if one not in signals] if name is None else self.names, name)
        if found is None and name is None and self.index is None:
            found = self._stored_index()
        if found is None and name is None and self.index is None:
            raise Error(
                f"there is no column `t` or `time`, and no index of times; the frame has: {near('t', self.names)}. Name the column "
                'by time="...", or give the time between samples (s) by sample_time=...'
            )
        if found is None and (name is None or (index is not None and time_column([index], name) is not None)):
            what = "the index" if index is None else f"the index `{index}`"
            return _counted(_stamps(self.index, what), index or "t"), what
        if found is None:
            raise Error(f"there is no column `{name}` for the time; the frame has: {near(str(name), self.names)}")
        what = f"column `{found}`"
        if self._arrays is not None:
            return _counted(_stamps(self._arrays[self._called[found]], what), found), what
        column = self._frame.get_column(self._called[found])
        dated = _dated(column)
        return (_counted(_stamps(column.to_numpy(), what), found) if dated is None else dated), what


def positive_time(given: Any) -> float:
    """Give a time between samples.

    Raises
    ------
    Error
        If it is not positive and finite.
    """
    sample_time = number("sample_time", given)
    if not (np.isfinite(sample_time) and sample_time > 0.0):
        raise Error(f"the sample time is {sample_time!r}; it must be positive and finite (s)")
    return sample_time


def steps(sample_time: float, rows: int, beside: tuple[Array, str] | None) -> Array:
    """Give times a sample time apart, beside the times of a column, if there is one.

    Raises
    ------
    Error
        If these are others.
    """
    between = np.zeros(0) if beside is None else np.diff(beside[0])
    other = between[~(np.abs(between - sample_time) <= _SAME * sample_time)]
    if beside is not None and len(other):
        raise Error(
            f"sample_time={sample_time!r} and {beside[1]}, where {other[0]:.6g} s lie between samples, both give the time of the samples; "
            "leave sample_time out, or drop the column"
        )
    return np.arange(rows, dtype=np.float64) * sample_time


def place(names: Sequence[str], column: str, signal: str, unit: str) -> str | None:
    """Give the column of this name, with a unit behind it or without, that holds a signal of a unit; `None` if there is none.

    Raises
    ------
    Error
        If there are several, or the column says a unit that is known and not that of the signal.
    """
    try:
        at = _core.Header(list(names)).column(column, signal, unit)
    except Error as error:
        stands = r", or (by 1|(give )?a frame as it stands) if the file's unit is wrong"
        raise Error(re.sub(stands, ", or rename the column if its unit is wrong", in_python(str(error)))) from None
    return None if at is None else names[at]


def time_column(names: Sequence[str], said: str | None = None) -> str | None:
    """Give the column of the time, of this name or of a usual one, with a unit behind it or without; `None` if there is none."""
    usual = next((one for one in _TIMES if one in names), None) if said is None else None
    if usual is not None:
        return usual
    at = _core.Header(list(names)).time(said)
    return None if at is None else names[at]


def _counted(stamps: Any, name: str) -> Any:
    """Give numbers in seconds, from the unit that the name of their column says, or, so large, from one since 1970, with a warning.

    Whole ones since 1970 are given as durations.
    """
    if stamps.dtype.kind == "m":
        return stamps
    header = _core.Header(["t" if name == INDEX else name])
    try:
        unit, origin = header.seconds(0, float(stamps[0]) if len(stamps) else 0.0)
        named, _ = header.seconds(0, 1.0)
    except Error as error:
        raise Error(in_python(str(error))) from None
    if origin != 0.0 and named != unit:
        taken = f"the times in `{name}` are taken as {_SINCE_1970[unit]} since 1970 (the first is {origin:.15g})"
        warn(RecordWarning(f"{taken}; if they are others, say their unit in the name, such as `{name} [ns]`"))
    if origin != 0.0 and stamps.dtype.kind == "i":
        # As durations, since nanoseconds from 1970 on are off by up to 128 as floats.
        return (stamps * round(unit * 1e9)).astype("timedelta64[ns]")
    stamps = stamps.astype(np.float64, copy=False)
    return stamps if (unit, origin) == (1.0, 0.0) else (stamps - origin) * unit


def has_times(data: Any) -> bool:
    """Whether a frame has a column of the time, or an index of times."""
    return time_column(list(map(str, data.columns))) is not None or _index(data) is not None


class Native:
    """Makes frames of a library of this name."""

    def __init__(self, library: str) -> None:
        self.library = library

    def __call__(self, columns: Mapping[str, Any]) -> Any:
        import narwhals as nw

        backend: Any = self.library
        return nw.from_dict(dict(columns), backend=backend).to_native()


def _narwhals(data: Any) -> Any:
    import narwhals as nw

    try:
        frame = nw.from_native(data)
    except (ValueError, nw.exceptions.NarwhalsError) as error:
        raise Error(f"the frame cannot be read: {error}") from None
    except TypeError:
        if not hasattr(data, "__arrow_c_stream__"):
            raise Error(
                f"{type(data).__name__} is no frame; hand over one of pandas, polars or Arrow, or a dict of arrays by name"
            ) from None
        frame = nw.from_arrow(data, backend="pyarrow")
    return frame.collect() if isinstance(frame, nw.LazyFrame) else frame


def _index(data: Any) -> Any:
    """Give the index of a pandas frame, unless it counts the rows."""
    index = getattr(data, "index", None)
    if index is None or callable(index) or type(data).__module__.partition(".")[0] not in ("pandas", "modin", "cudf"):
        return None
    # So does what is left of a range where rows were dropped.
    counts = type(index).__name__ == "RangeIndex" or (index.name is None and getattr(index.dtype, "kind", "") in "iu")
    return None if counts else index


def _dated(column: Any) -> Any:
    """Give the nanoseconds of dates or durations; `None` where the column has others."""
    import narwhals as nw

    if column.dtype == nw.Datetime or column.dtype == nw.Date:
        dates = column.cast(nw.Datetime("ns")) if column.dtype == nw.Date else column
        missing, stamps = column.is_null().any(), dates.dt.timestamp("ns")
    elif column.dtype == nw.Duration:
        dates = column
        missing, stamps = column.is_null().any(), column.dt.total_nanoseconds()
    else:
        return None
    if missing:
        zone = getattr(column.dtype, "time_zone", None)
        plain = dates.dt.convert_time_zone("UTC").dt.replace_time_zone(None) if zone else dates
        return _stamps(plain.to_numpy(), f"column `{column.name}`")
    return stamps.to_numpy().astype("timedelta64[ns]")


def _numbers(column: Any, name: str) -> Array:
    import narwhals as nw

    if not (column.dtype.is_numeric() or column.dtype == nw.Boolean):
        values = column.drop_nulls().head(1).to_list()
        if values:
            raise _no_numbers(name, values[0], str(column.dtype))
        return np.full(len(column), np.nan)
    if column.dtype != nw.Float64:
        column = column.cast(nw.Float64)
    return _array_numbers(column.to_numpy(), name)


def _no_numbers(name: str, value: Any, kind: str) -> Error:
    hint = "; it has dates, which only the time may have" if "date" in kind.lower() else "; convert it first, such as by pandas.to_numeric"
    return Error(f"column `{name}` has {value!r} ({kind}), which is no number{hint}")


def _called(names: Iterable[Any]) -> dict[str, Any]:
    """Give the names of columns, which may be numbers, by what they are as text."""
    found: dict[str, Any] = {}
    for name in names:
        other = found.setdefault(str(name), name)
        if other != name:
            raise Error(f"the frame has two columns `{name}`, {other!r} and {name!r}; rename one")
    return found


def _entries(values: Any, name: str) -> Any:
    """Give a column of any kind of entries as an array."""
    array = _as_array(values, f"column `{name}`")
    # Of numbers beside text, NumPy makes text.
    mixed = array.dtype.kind == "U" and isinstance(values, (list, tuple)) and not all(isinstance(one, str) for one in values)
    array = np.array(values, dtype=object) if mixed else array
    if array.ndim != 1:
        raise Error(f"column `{name}` has the shape {array.shape}; give one entry per sample")
    return array


def _as_array(values: Any, what: str) -> Any:
    try:
        return np.asarray(values)
    except ValueError as error:
        raise Error(f"{what} is no array: {error}") from None


def _array_numbers(values: Any, name: str) -> Array:
    masked = isinstance(values, np.ma.MaskedArray) and values.dtype.kind in "fiub"
    array = np.ma.filled(values.astype(np.float64), np.nan) if masked else _as_array(values, f"column `{name}`")
    if array.ndim != 1:
        raise Error(f"column `{name}` has the shape {array.shape}; give one number per sample")
    if array.dtype.kind not in "fiub":
        try:
            if array.dtype.kind != "O":
                raise TypeError
            return np.array([np.nan if one is None else float(one) for one in array.tolist() if not isinstance(one, str) or _refuse(one)])
        except (TypeError, ValueError, OverflowError):
            bad = next((one for one in array.tolist() if not isinstance(one, (int, float))), array[:1].tolist())
            raise _no_numbers(name, bad, str(array.dtype)) from None
    return np.ascontiguousarray(array, dtype=np.float64)


def _refuse(text: str) -> bool:
    raise TypeError(text)


def _stamps(values: Any, what: str) -> Any:
    """Give times as they stand: numbers (s), or durations since an instant (ns)."""
    if getattr(values, "tz", None) is not None:
        values = values.tz_convert("UTC").tz_localize(None)
    array = _as_array(values, what)
    if array.ndim != 1:
        raise Error(f"{what} has the shape {array.shape}; give one time per sample")
    if array.dtype.kind in "mM":
        of = array.astype("datetime64[ns]") if array.dtype.kind == "M" else array.astype("timedelta64[ns]")
        return of.astype(np.int64).astype("timedelta64[ns]")
    if array.dtype.kind in "fiu":
        # Those of small unsigned kinds have no differences.
        return np.ascontiguousarray(array, dtype=np.int64 if array.dtype.kind == "i" else np.float64)
    shown = f"has {array.tolist()[0]!r} ({array.dtype})" if array.size else "is empty"
    raise Error(
        f"{what} {shown}, which is neither a number (s) nor a date; convert it first, such as by pandas.to_datetime, or give the time "
        "between samples by sample_time=..."
    )


def seconds(stamps: Any, what: str) -> Array:
    """Give times in seconds; durations in nanoseconds count from the first.

    Raises
    ------
    Error
        If one is missing, or they do not increase.
    """
    if stamps.dtype.kind == "m" and np.isnat(stamps).any():
        raise Error(f"{what} has rows without a time; drop them")
    return _since_first(stamps.astype(np.int64), what) if stamps.dtype.kind == "m" else stamps


def _since_first(stamps: Any, what: str) -> Array:
    if (np.diff(stamps) < 0).any():
        k = int(np.argmax(np.diff(stamps) < 0)) + 1
        jump = (stamps[k] - stamps[k - 1]) / 1e9
        raise Error(
            f"{what} does not increase: row {k} (from zero) is {jump:g} s after the row before it. Sort the rows; "
            "where clocks were set back for winter, give the times their zone (tz_localize)"
        )
    seconds: Array = (stamps - (stamps[0] if len(stamps) else 0)) / 1e9
    return seconds


def is_readonly(array: Array) -> bool:
    """Whether nothing in Python can write to the array, which may then be shared."""
    owner: Any = array
    while isinstance(owner, np.ndarray):
        if owner.flags.writeable:
            return False
        owner = owner.base
    # Arrow may share memory of NumPy, and a file that is mapped may be written to.
    shared = isinstance(owner, (bytearray, memoryview, mmap.mmap)) or type(owner).__module__.startswith("pyarrow")
    return owner is not None and not shared


def named_columns(given: Any) -> dict[str, str]:
    """Give what is said of the columns of signals, as text.

    Raises
    ------
    Error
        If it is no mapping to names of columns.
    """
    each = mapping("columns", given, 'the column of each signal that has another name: {"signal": "column"}')
    return {str(signal): column_name(f"the column of `{signal}`", column) for signal, column in each.items()}


def joined(columns: Iterable[tuple[str, Any]]) -> dict[str, Any]:
    """Give columns by their names; one that occurs again is the same.

    Raises
    ------
    Error
        If two of one name have other values.
    """
    found: dict[str, Any] = {}
    for name, column in columns:
        if name in found and not np.array_equal(found[name], column, equal_nan=found[name].dtype.kind == "f"):
            raise Error(f"the table would have two columns `{name}` of other values; rename the signal of the model that has this name")
        found[name] = column
    return found


def rename(names: Iterable[str], columns: Mapping[str, str] | None) -> dict[str, str]:
    """Give the column of each signal.

    Raises
    ------
    Error
        If a signal is renamed that the model does not have.
    """
    of = {name: name for name in names}
    for signal, column in (columns or {}).items():
        if signal not in of:
            raise Error(f"columns names `{signal}`, which is no input or output of the model; it has: {near(signal, of)}")
        of[signal] = column
    return of
