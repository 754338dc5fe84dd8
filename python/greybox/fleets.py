"""Fleets: the same fit of many records, each by itself."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from greybox import _core
from greybox.checks import column_name
from greybox.errors import Error
from greybox.estimate import VERDICTS
from greybox.frames import INDEX, Frame, is_readonly, place, rename, seconds, steps, time_column
from greybox.model import Model, checked
from greybox.options import Options, settings
from greybox.parameters import Parameter, declared, together
from greybox.progress import Progress
from greybox.records import Hold, Initial, Record, framed, kind_of, opened
from greybox.signals import named, near

__all__ = ["Plan", "fleet"]


class Plan:
    """A fit to be made of each of many records; what pickle sends to the workers of a cluster.

    Parameters
    ----------
    model : Model
        The equations; they are read once, here.
    by : str or sequence of str
        The columns that tell the records apart.
    parameters, options
        As in :func:`greybox.fit`.
    record
        What is said of all records.
    """

    def __init__(
        self,
        model: Model,
        by: str | Sequence[str],
        parameters: Mapping[str, Parameter],
        options: Options,
        record: Record,
    ) -> None:
        if options.get("checkpoint") is not None:
            raise Error("a fleet has no checkpoint; fit the records in parts, and keep the rows of each")
        self.equations = checked(model).equations()
        self.by = _keys(by)
        self.declared = declared({**self.equations.declared, **parameters}, named(self.equations.parameters, "parameters"))
        self.options = settings(self.equations, options)
        self.record = record
        named_twice = _repeated(self._names())
        if named_twice is not None:
            raise Error(f"the result would have two columns `{named_twice}`; rename the parameter or the output that has this name")
        taken = [name for name in self.by if name in self.columns()]
        if taken:
            raise Error(f"the column `{taken[0]}` of by has the name of a column of the result; rename it")
        self._check()

    def _check(self) -> None:
        """Refuse what is wrong for all records, by one of two samples and a fleet of none."""
        zeros = (np.zeros(2), False)
        columns = {column: zeros for _, column, _ in self._signals()}
        self.record.of(self.equations, "record", np.array([0.0, 1.0]), columns)
        _core.fleet(self.equations.core, [], self.declared, self.options, None)

    def _signals(self) -> list[tuple[str, str, str]]:
        """Give the name of each input and output, the column that is said of it, and its unit."""
        inputs, outputs = named(self.equations.inputs, "inputs"), named(self.equations.outputs, "outputs")
        of = rename([*inputs, *outputs], self.record.columns)
        return [(signal, of[signal], unit) for signal, unit in [*inputs.items(), *outputs.items()]]

    def needed(self, names: Sequence[str]) -> list[str]:
        """Give those of the columns of a frame that are read, but for the time.

        Raises
        ------
        Error
            If one is missing, or has another unit than its signal.
        """
        keys = [(name, name if name in names else None) for name in self.by]
        signals = [(column, place(names, column, signal, unit)) for signal, column, unit in self._signals()]
        for wanted, found in [*keys, *signals]:
            if found is None:
                raise Error(f"there is no column `{wanted}`; the frame has: {near(wanted, names)}")
        return list(dict.fromkeys(found for _, found in [*keys, *signals] if found is not None))

    def shuffled(self, names: Sequence[str]) -> list[str]:
        """Give those of the columns of a frame that a shuffle has to keep.

        Raises
        ------
        Error
            If one is missing, or if there is a constant step in the place of a column of the time.
        """
        if self.record.sample_time is not None:
            raise Error("a shuffle does not keep the order of samples, which sample_time needs; add a column of the time")
        needed = self.needed(names)
        signals = [column for _, column, _ in self._signals()]
        time = time_column(names if self.record.time else [name for name in names if name not in signals], self.record.time)
        if time is None and self.record.time is None and INDEX in names:
            time = INDEX
        if time is None and self.record.time is not None:
            raise Error(f"there is no column `{self.record.time}`; the frame has: {near(self.record.time, names)}")
        if time is None:
            raise Error(f"there is no column `t` or `time`; the frame has: {near('t', names)}. Name the column by time=\"...\"")
        return list(dict.fromkeys([*needed, time]))

    def columns(self) -> dict[str, type]:
        """Give the columns of the result beside those of `by`, with the kind of their values."""
        words = {"samples": int, "verdict": str, "outcome": str, "warnings": str, "reason": str}
        return {name: words.get(name, float) for name in self._names()}

    def _names(self) -> list[str]:
        parameters, outputs = named(self.equations.parameters, "parameters"), named(self.equations.outputs, "outputs")
        numbers = [name + end for name in parameters for end in ("", "_error", "_lower", "_upper")]
        return ["samples", *numbers, *(f"{name}_rmse" for name in outputs), "verdict", "outcome", "warnings", "reason"]

    def rows(self, data: Any, *, ordered: bool = False, progress: bool = False) -> dict[str, Any]:
        """Fit the records of a frame and give a row for each, in the order of their first samples.

        Parameters
        ----------
        data : frame
            The samples of all records, one below the other.
        ordered : bool
            Whether the samples of a record are brought into the order of their time first, as after a shuffle.
        progress : bool
            Show how many records are done (needs tqdm).
        """
        data = opened(data)
        if isinstance(data, Path):
            raise Error(f"{data}: text files of many records are read by pandas: gb.fleet(model, pandas.read_csv({str(data)!r}), ...)")
        frame = Frame(data)
        # Raises if one is missing.
        self.needed(frame.names)
        keys = [frame.values(name) for name in self.by]
        columns = {column: frame.column(column, signal, unit) for signal, column, unit in self._signals()}
        step = self.record.sample_time
        signals = [column for _, column, _ in self._signals()]
        # Beside a sample time, the times of a column are compared with it.
        times, what = frame.stamps(self.record.time, signals) if step is None else frame.beside(signals) or (None, "")
        lengths = {f"column `{name}`": len(column) for name, column in [*zip(self.by, keys, strict=True), *columns.items()]}
        _check_lengths(lengths if times is None else {**lengths, what: len(times)})
        places, firsts = _groups(keys)
        of_record = {name: frame.rows(name, firsts) for name in self.by}
        labels = [", ".join(map(str, one)) for one in zip(*(_list(key) for key in of_record.values()), strict=True)]
        readonly = {name: is_readonly(column) for name, column in columns.items()}
        records: list[_core.Record] = []
        failed: dict[int, str] = {}
        for k, rows in enumerate(places):
            here = np.zeros(0) if times is None else times[rows]
            if ordered and step is None and (here[1:] < here[:-1]).any():
                order = np.argsort(here, kind="stable")
                rows, here = (np.arange(rows.start, rows.stop) if isinstance(rows, slice) else rows)[order], here[order]
            # A part of an array that nothing writes to is shared; rows that are gathered are a copy already.
            part = {name: (column[rows], readonly[name] or not isinstance(rows, slice)) for name, column in columns.items()}
            try:
                time = np.zeros(0) if times is None else seconds(here, what)
                if step is not None:
                    time = steps(step, _length(rows), None if times is None else (time, what))
                records.append(self.record.of(self.equations, labels[k], time, part))
            except Error as error:
                failed[k] = str(error)
        with Progress(progress, "fleet", len(records)) as shown:
            answers = iter(_core.fleet(self.equations.core, records, self.declared, self.options, shown))
        found: dict[str, list[Any]] = {name: [] for name in self.columns()}
        for k, rows in enumerate(places):
            estimate, reason = (None, failed[k]) if k in failed else next(answers)
            for name, value in self._row(estimate, reason, _length(rows)).items():
                found[name].append(value)
        return {**of_record, **found}

    def _row(self, estimate: _core.Estimate | None, reason: str | None, samples: int) -> dict[str, Any]:
        row: dict[str, Any] = {name: float("nan") if kind is float else "" for name, kind in self.columns().items()}
        row |= {"samples": samples, "verdict": "failed", "reason": reason or ""}
        if estimate is None:
            return row
        for name, _, value, _, error, interval, _ in estimate.parameters:
            row[name] = value
            row[f"{name}_error"] = float("nan") if error is None else error
            row[f"{name}_lower"], row[f"{name}_upper"] = interval or (float("nan"), float("nan"))
        for name, _, _, rmse, _, _ in estimate.outputs:
            row[f"{name}_rmse"] = rmse
        codes = dict.fromkeys(code for code, severity, _ in estimate.warnings if severity != "usable")
        row |= {"verdict": VERDICTS[estimate.severity], "outcome": estimate.outcome[0], "warnings": " ".join(codes)}
        return row


def _list(column: Any) -> list[Any]:
    """Give the entries of a column of any kind; Arrow and polars have another name for that than NumPy and pandas."""
    entries: list[Any] = next(getattr(column, name) for name in ("tolist", "to_pylist", "to_list") if hasattr(column, name))()
    return entries


def _keys(by: Any) -> list[str]:
    """Give the names of the columns that tell the records apart."""
    several = list(by) if isinstance(by, Iterable) and not isinstance(by, str) else [by]
    names = [column_name("by", one) for one in several]
    if not names:
        raise Error(f"by is {by!r}; name at least one column that tells the records apart")
    return names


def _repeated(names: Sequence[str]) -> str | None:
    """Give a name that occurs twice, if there is one."""
    return next((name for k, name in enumerate(names) if name in names[:k]), None)


def _check_lengths(of: Mapping[str, int]) -> None:
    first, *others = of
    for name in others:
        if of[name] != of[first]:
            raise Error(f"{name} has {of[name]} rows, and {first} has {of[first]}; every sample needs both")


#: The rows of one record: a part of the frame, or here and there.
_Rows: TypeAlias = "slice | np.ndarray[Any, np.dtype[np.int64]]"


def _length(rows: _Rows) -> int:
    return rows.stop - rows.start if isinstance(rows, slice) else len(rows)


def _groups(keys: list[Any]) -> tuple[list[_Rows], Any]:
    """Give the rows of each record, in the order of its first row, and these first rows."""
    if len(keys[0]) == 0:
        return [], np.zeros(0, dtype=np.int64)
    # Rows of one record mostly follow each other: only the first of each run is looked up.
    new = np.ones(len(keys[0]), dtype=bool)
    new[1:] = np.any([_differs(key) for key in keys], axis=0)
    starts = np.flatnonzero(new)
    codes: Any = None
    for key in keys:
        inverse = _numbered(key[starts])
        if codes is not None:
            _, inverse = np.unique(codes * (int(inverse.max()) + 1) + inverse, return_inverse=True)
        codes = inverse
    # Numbers of 16 bits are sorted in one pass.
    of = np.repeat(codes.astype(np.min_scalar_type(int(codes.max()))), np.diff(starts, append=len(new)))
    order = np.argsort(of, kind="stable")
    ends = np.cumsum(np.bincount(of))
    firsts = order[np.concatenate([[0], ends[:-1]])]
    lasts = order[ends - 1]

    def rows(k: int) -> _Rows:
        length = ends[k] - (ends[k - 1] if k else 0)
        first, last = int(firsts[k]), int(lasts[k])
        return slice(first, last + 1) if last - first + 1 == length else order[ends[k] - length : ends[k]]

    turn = np.argsort(firsts, kind="stable")
    return [rows(k) for k in turn.tolist()], firsts[turn]


def _differs(key: Any) -> Any:
    """Whether each entry but the first differs from the one before."""
    try:
        return (key[1:] != key[:-1]).astype(bool)
    except TypeError:
        # pandas' NA, whose comparison is no answer.
        key = _numbered(key)
        return key[1:] != key[:-1]


def _numbered(key: Any) -> Any:
    """Number the entries: equal ones alike, and text is never equal to a number."""
    if key.dtype != object:
        return np.unique(key, return_inverse=True)[1]
    numbers: dict[Any, int] = {}
    return np.array([numbers.setdefault(_hashable(one), len(numbers)) for one in key.tolist()], dtype=np.int64)


def _hashable(entry: Any) -> Any:
    """Give an entry, or its text where it equals not even itself, as what is missing, or has no hash."""
    try:
        hash(entry)
        return entry if entry == entry else (None, str(entry))
    except (TypeError, ValueError):
        return None, str(entry)


def plan(
    model: Model,
    by: str | Sequence[str],
    parameters: Mapping[str, Parameter] | None,
    record: Record,
    given: dict[str, Any],
) -> Plan:
    """Make a plan of what a fleet is told: options and, by name, parameters."""
    options = {name: value for name, value in given.items() if name in Options.__annotations__}
    by_name = {name: value for name, value in given.items() if name not in options}
    misplaced = [name for name, value in options.items() if isinstance(value, Parameter)]
    if misplaced:
        raise Error(f"`{misplaced[0]}` is an option; declare the parameter of this name by parameters={{\"{misplaced[0]}\": ...}}")
    return Plan(model, by, together(parameters, by_name, Options.__annotations__), Options(**options), record)  # type: ignore[typeddict-item]


def fleet(
    model: Model,
    data: Any,
    /,
    by: str | Sequence[str],
    *,
    parameters: Mapping[str, Parameter] | None = None,
    time: str | None = None,
    sample_time: float | None = None,
    columns: Mapping[str, str] | None = None,
    hold: Hold | None = None,
    initial: Initial | None = None,
    progress: bool = False,
    **given: Any,
) -> Any:
    """Fit many records, each by itself: motors on a test bench, drives in the field.

    The fits run side by side in vector registers and on all cores.

    Parameters
    ----------
    model : Model
        The equations.
    data : frame or path
        The samples of all records, one below the other, or a file of them that :func:`greybox.read` reads.
    by : str or sequence of str
        The columns that tell the records apart.
    parameters, time, sample_time, columns, hold, initial
        As in :func:`greybox.fit`, of each record.
    progress : bool
        Show how many records are done (needs tqdm).
    **given
        The declarations of the parameters, and the options of :func:`greybox.fit`.

    Returns
    -------
    frame
        Of the kind that was handed over, a row for each record: the columns of `by`, ``samples``; for each parameter ``rs``,
        ``rs_error`` (standard error), ``rs_lower``, ``rs_upper`` (95 % interval; NaN where there is none); ``id_rmse`` of each output;
        ``verdict``, ``outcome`` and ``warnings`` (codes). A record that could not be fitted has the verdict ``"failed"`` and a ``reason``.

    Raises
    ------
    Error
        If nothing can be fitted: a column is missing, a parameter is not declared.

    Examples
    --------
    >>> import greybox as gb
    >>> import numpy as np
    >>> cooling = gb.model(
    ...     lambda t, x, u, p: [p.k * (20 - x.body)], states={"body": "K"}, outputs={"body": "K"}, parameters={"k": "1/s"}
    ... )
    >>> t = np.tile(np.arange(200) * 0.1, 2)
    >>> which = np.repeat(["a", "b"], 200)
    >>> body = 20 + 60 * np.exp(-np.where(which == "a", 0.3, 0.4) * t) + np.random.default_rng(1).normal(0.0, 0.05, 400)
    >>> rows = gb.fleet(cooling, {"t": t, "body": body, "which": which}, by="which", k=gb.free(1.0))
    >>> [round(float(k), 2) for k in rows["k"]]
    [0.3, 0.4]
    """
    made = plan(model, by, parameters, Record(None, None, time, sample_time, columns, hold, initial), given)
    data = framed(data)
    return kind_of(data)(made.rows(data, progress=progress))
