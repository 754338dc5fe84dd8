"""Records: a frame with what is said about it, as the compiled library takes it."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal, TypeAlias

import numpy as np

from greybox import _core
from greybox.checks import column_name, mapping, text
from greybox.errors import Error, in_python
from greybox.files import TEXT, read
from greybox.frames import Array, Frame, Kind, is_readonly, named_columns, place, positive_time, rename
from greybox.model import Equations
from greybox.parameters import Parameter, said
from greybox.signals import Signals, named

__all__ = ["Hold", "Initial", "Record", "filled", "framed", "is_path", "kind_of", "opened", "records"]

#: The inputs between samples, of all or by the name of each.
Hold: TypeAlias = "Literal['zero', 'first'] | Mapping[str, Literal['zero', 'first']]"

#: What is said of the state at the first sample.
Initial: TypeAlias = "Literal['estimated', 'first', 'steady'] | Mapping[str, Parameter]"


@dataclass(frozen=True)
class Record:
    """A frame with what is said about it; a bare frame does where there is nothing to say.

    Parameters
    ----------
    data : frame
        pandas, polars, Arrow (or whatever hands over an Arrow stream), a mapping from names to arrays, an xarray dataset, or a
        structured array. A row for each sample, a column for each signal, of its name, with a unit behind it or without (``u [V]``); a known
        unit that is not the signal's is refused; further columns are ignored. Numbers as names count as their text. Or the path of a file:
        of text with columns (``.csv``), in which what is not said is found, or of a kind that :func:`greybox.read` reads.
    name : str, optional
        The name in reports and errors; without it that of the file, without its ending.
    time : str, optional
        The column of the time: dates, which count from the first, or numbers in seconds or in the unit that its name says (``t [ms]``,
        ``time_ms``). Without it, the column ``t`` or ``time`` that is no signal's, with a unit or without, or else the index of a pandas frame; of
        one without a name also in the table of Arrow, or the file, that it was written to.
    sample_time : float, optional
        The time between samples (s), where there is no column.
    columns : mapping from str to str, optional
        The column of a signal, where it has another name: ``{"w": "speed"}``.
    hold : {"zero", "first"}, or mapping from input to these
        The inputs between samples: constant, as a digital controller commands them, or straight lines, as measured quantities go.
        Inputs that a mapping leaves out, and all without one, are as a model file says, or constant.
    initial : {"estimated", "first", "steady"} or mapping from str to Parameter
        The state at the first sample: estimated, computed from the first sample, or declared by :func:`~greybox.free` and
        :func:`~greybox.fixed`; states that a mapping leaves out are as a model file declares them, or estimated from zero on. Without
        it, as a model file says, or estimated.

    Raises
    ------
    Error
        If two of `time`, `sample_time` and `columns` of ``t`` are given, `sample_time` beside a column of another time, or something of
        another kind than it has to be.
    """

    data: Any
    name: str | None = None
    time: str | None = None
    sample_time: float | None = None
    columns: Mapping[str, str] | None = None
    hold: Hold | None = None
    initial: Initial | None = None

    def __post_init__(self) -> None:
        checked: dict[str, Any] = {
            "name": text("the name of the record", self.name),
            "time": None if self.time is None else column_name("time", self.time),
            "sample_time": None if self.sample_time is None else positive_time(self.sample_time),
            "columns": None if self.columns is None else named_columns(self.columns),
        }
        for name, value in checked.items():
            # A frozen class sets its fields in no other way.
            object.__setattr__(self, name, value)
        if self.time is not None and self.sample_time is not None:
            raise Error(f"time={self.time!r} and sample_time={self.sample_time!r} both give the time of the samples; leave one out")
        if self.columns is not None and "t" in self.columns:
            for name, given in (("time", self.time), ("sample_time", self.sample_time)):
                if given is not None:
                    both = f"columns={{'t': {self.columns['t']!r}}} and {name}={given!r}"
                    raise Error(f"{both} both give the time of the samples; leave one out")

    def core(self, equations: Equations, name: str, *, outputs: bool = True) -> _core.Record:
        """Give the record as the library takes it. Without `outputs`, those that the frame lacks are missing measurements."""
        inputs, measured = named(equations.inputs, "inputs"), named(equations.outputs, "outputs")
        data, name = opened(self.data), self.name or (Path(self.data).stem if is_path(self.data) else name)
        if isinstance(data, Path):
            columns_ = {**(self.columns or {}), **({} if self.time is None else {"t": self.time})}
            try:
                record = _core.Record.from_csv(equations.core, name, data, columns_, self.sample_time)
            except Error as error:
                raise Error(in_python(str(error))) from None
            return self._said(equations, record)
        frame = Frame(data)
        try:
            of = rename([*inputs, *measured], self.columns)
            columns = {signal: frame.column(of[signal], signal, unit) for signal, unit in inputs.items()}
            rows = len(next(iter(columns.values()))) if columns else None
            found: dict[str, Array] = {}
            for signal, unit in measured.items():
                if outputs or place(frame.names, of[signal], signal, unit) is not None:
                    found[signal] = frame.column(of[signal], signal, unit)
                    rows = len(found[signal])
            rows = 0 if rows is None else rows
            time = frame.time(self.time, self.sample_time, rows, of.values())
            _check_lengths({**{of[signal]: column for signal, column in {**columns, **found}.items()}}, time)
            missing = np.full(len(time), np.nan)
            given = {**columns, **{signal: found.get(signal, missing) for signal in measured}}
            return self.of(equations, name, time, {of[signal]: _shared(one) for signal, one in given.items()})
        except Error as error:
            if self.name and self.name not in str(error):
                raise Error(f"record `{self.name}`: {error}") from None
            raise

    def of(self, equations: Equations, name: str, time: Array, columns: Mapping[str, tuple[Array, bool]]) -> _core.Record:
        """Give the record of columns, each with whether it may be shared, and with what is said here."""
        of = rename([*named(equations.inputs, "inputs"), *named(equations.outputs, "outputs")], self.columns)
        inputs = [columns[of[signal]] for signal in named(equations.inputs, "inputs")]
        outputs = [columns[of[signal]] for signal in named(equations.outputs, "outputs")]
        return self._said(equations, _core.Record(equations.core, name, time, inputs, outputs))

    def _said(self, equations: Equations, record: _core.Record) -> _core.Record:
        # A mapping of nothing says nothing.
        given = None if isinstance(self.initial, Mapping) and not self.initial else self.initial
        initial = given if given is None or isinstance(given, str) else said(given, _states(equations), "initial state of")
        return equations.prepared(record).said(_holds(self.hold), initial)


def opened(data: Any) -> Any:
    """Give the frame in a file, where a path stands in its place; of a text file the path, which the compiled library reads."""
    if not is_path(data):
        return data
    path = Path(data)
    return path if path.suffix.lower() in TEXT else read(path)


def is_path(data: Any) -> bool:
    """Whether the path of a file stands in the place of data."""
    return isinstance(data, (str, os.PathLike))


def framed(data: Any) -> Any:
    """Give data as a frame that is opened once, as a stream has to be; a path stays one."""
    return data if is_path(data) else Frame(data)


def kind_of(data: Any) -> Kind:
    """Give what makes a frame of the same kind; dicts where the data are a path."""
    return dict if is_path(data) else Frame(data).kind


def _holds(hold: Any) -> str | dict[str, str] | None:
    if hold is None or isinstance(hold, str):
        return hold
    each = dict(mapping("hold", hold, '"zero", "first", or one of them for each input by its name'))
    return {str(name): text(f"hold of `{name}`", one) or "" for name, one in each.items()}


def _states(equations: Equations) -> Signals:
    return named(equations.states, "states")


def _shared(array: Array) -> tuple[Array, bool]:
    return array, is_readonly(array)


def _check_lengths(columns: Mapping[str, Array], time: Array) -> None:
    for name, column in columns.items():
        if len(column) != len(time):
            raise Error(f"column `{name}` has {len(column)} rows, and there are {len(time)} times; every sample needs both")


def records(data: Any, defaults: Record) -> list[Record]:
    """Give one or several records; what is said for all holds for each where it does not say it itself."""
    several = list(data) if isinstance(data, (list, tuple)) else [data]
    if not several:
        raise Error("there is no record; hand over a frame, or a list of at least one")
    asked = [one if isinstance(one, Record) else Record(one) for one in several]
    return [replace(filled(one, defaults), data=framed(one.data)) for one in asked]


def filled(record: Record, defaults: Record) -> Record:
    """Give a record in which what it does not say itself is as in another."""
    said: dict[str, Any] = {name: getattr(record, name) for name in ("columns", "hold", "initial")}
    said = {name: getattr(defaults, name) if one is None else one for name, one in said.items()}
    if record.time is None and record.sample_time is None:
        said |= {"time": defaults.time, "sample_time": defaults.sample_time}
    return replace(record, **said)
