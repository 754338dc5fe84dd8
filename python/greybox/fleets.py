"""Fleets: the same fit of many records, each by itself."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from greybox import _core
from greybox.errors import Error
from greybox.frames import Frame
from greybox.model import Model, checked
from greybox.options import Options, settings
from greybox.parameters import Parameter, declared, together
from greybox.progress import Progress
from greybox.records import Hold, Initial, Record
from greybox.result import VERDICTS
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
        self.by = [by] if isinstance(by, str) else list(by)
        self.declared = declared({**self.equations.declared, **parameters}, named(self.equations.parameters, "parameters"))
        self.options = settings(self.equations, options)
        self.record = record
        taken = [name for name in self.by if name in self.columns()]
        if taken:
            raise Error(f"the column `{taken[0]}` of by has the name of a column of the result; rename it")

    def needed(self) -> list[str]:
        """Give the columns that are read, but for the time."""
        renamed = self.record.columns or {}
        signals = [*named(self.equations.inputs, "inputs"), *named(self.equations.outputs, "outputs")]
        return [*self.by, *(renamed.get(name, name) for name in signals)]

    def columns(self) -> dict[str, type]:
        """Give the columns of the result beside those of `by`, with the kind of their values."""
        of: dict[str, type] = {"samples": int}
        for name in named(self.equations.parameters, "parameters"):
            of |= {name: float, f"{name}_error": float, f"{name}_lower": float, f"{name}_upper": float}
        for name in named(self.equations.outputs, "outputs"):
            of[f"{name}_rmse"] = float
        return of | {"verdict": str, "outcome": str, "warnings": str, "reason": str}

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
        frame = Frame(data)
        missing = [name for name in self.needed() if name not in frame]
        if missing:
            raise Error(f"there is no column `{missing[0]}`; the frame has: {near(missing[0], frame.names)}")
        keys = [frame.values(name) for name in self.by]
        places, firsts = _groups(keys)
        columns = {name: frame.column(name, name) for name in self.needed() if name not in self.by}
        times = None if self.record.sample_time else frame.stamps(self.record.time)[0]
        records: list[_core.Record] = []
        failed: dict[int, str] = {}
        for k, rows in enumerate(places):
            if ordered and times is not None:
                rows = rows[np.argsort(times[rows], kind="stable")]
            part: dict[str, Any] = {name: column[rows] for name, column in columns.items()}
            if times is not None:
                part["t"] = times[rows]
            label = ", ".join(str(key[firsts[k]]) for key in keys)
            said = Record(part, label, None, self.record.sample_time, self.record.columns, self.record.hold, self.record.initial)
            try:
                records.append(said.core(self.equations, label))
            except Error as error:
                failed[k] = str(error)
        with Progress(progress, "fleet", len(records)) as shown:
            answers = iter(_core.fleet(self.equations.core, records, self.declared, self.options, shown))
        found: dict[str, list[Any]] = {name: [] for name in self.columns()}
        for k, rows in enumerate(places):
            estimate, reason = (None, failed[k]) if k in failed else next(answers)
            for name, value in self._row(estimate, reason, len(rows)).items():
                found[name].append(value)
        return {**{name: key[firsts] for name, key in zip(self.by, keys, strict=True)}, **found}

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


def _groups(keys: list[Any]) -> tuple[list[Any], Any]:
    """Give the rows of each record, in the order of its first row, and these first rows."""
    codes = np.zeros(len(keys[0]), dtype=np.int64)
    for key in keys:
        _, inverse = np.unique(np.asarray(key).astype(str) if np.asarray(key).dtype == object else key, return_inverse=True)
        codes = codes * (int(inverse.max(initial=0)) + 1) + inverse
    _, first, inverse = np.unique(codes, return_index=True, return_inverse=True)
    if len(codes) == 0:
        return [], np.zeros(0, dtype=np.int64)
    together = np.split(np.argsort(inverse, kind="stable"), np.cumsum(np.bincount(inverse))[:-1])
    order = np.argsort(first, kind="stable")
    return [together[k] for k in order], first[order]


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
    data : frame
        The samples of all records, one below the other.
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
    return Frame(data).kind(made.rows(data, progress=progress))
