"""`Fit`: what was found, and how well it is known."""

from __future__ import annotations

import html
import json
import os
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from greybox import _core
from greybox.errors import Error, FitWarning
from greybox.frames import Array, Kind
from greybox.model import Equations, of_parameters
from greybox.parameters import Parameter
from greybox.profile import Profile
from greybox.records import Record
from greybox.report import Report
from greybox.signals import Values, Vector, named, near

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["Derived", "Fit"]

@dataclass(frozen=True)
class Derived:
    """A quantity that was computed from the parameters, with its standard error and 95 % interval; NaN where there is none."""

    name: str
    value: float
    standard_error: float
    lower: float
    upper: float


VERDICTS = {"usable": "usable", "usable_with_care": "usable with care", "not_usable": "not usable"}


class Fit:
    """The result of :func:`greybox.fit`. Printed, it is a table with the verdict above; in a notebook, with a plot.

    It can be pickled; the records are kept with it.
    """

    def __init__(
        self,
        equations: Equations,
        records: list[_core.Record],
        declared: list[Parameter],
        options: Mapping[str, Any],
        kind: Kind,
        estimate: _core.Estimate,
        problem: _core.Problem | None = None,
    ) -> None:
        self._equations = equations
        self._records = records
        self._declared = declared
        self._options = dict(options)
        self._kind = kind
        self._estimate = estimate
        self._made = problem

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_made": None}

    @property
    def _problem(self) -> _core.Problem:
        if self._made is None:
            self._made = _core.Problem(self._equations.core, self._records, self._declared, self._options)
        return self._made

    # What was found.
    @property
    def parameters(self) -> Values:
        """The value of each parameter, by name; of those that each record has for itself, the first record's."""
        rows = self._estimate.parameters
        return Values("parameters", [row[0] for row in rows], [row[2] for row in rows])

    @property
    def standard_errors(self) -> Values:
        """The standard error of each parameter; NaN where there is none: fixed, held at a bound, not determined."""
        rows = self._estimate.parameters
        return Values("standard_errors", [row[0] for row in rows], [_number(row[4]) for row in rows])

    @property
    def initial_state(self) -> Values:
        """The state at the first sample of the first record."""
        return Values("initial_state", named(self._equations.states, "states"), self._estimate.experiments[0][2])

    @property
    def verdict(self) -> str:
        """``"usable"``, ``"usable with care"`` or ``"not usable"``."""
        return VERDICTS[self._estimate.severity]

    @property
    def converged(self) -> bool:
        """Whether the search ended at a minimum."""
        return self._estimate.outcome[1]

    @property
    def outcome(self) -> str:
        """How the search ended, in words."""
        return self._estimate.outcome[2]

    @property
    def warnings(self) -> list[FitWarning]:
        """What the reader must know; the first is the search's, if it did not end at a minimum."""
        code, converged, words, advice = self._estimate.outcome
        ended = [] if converged else [FitWarning(code, "not_usable", f"the search has {words}. {advice}")]
        return ended + [FitWarning(*warning) for warning in self._estimate.warnings]

    @property
    def unknowns(self) -> list[str]:
        """The names of all free quantities, initial states too, in the order of the covariance."""
        return [row[0] for row in self._estimate.unknowns]

    @property
    def covariance(self) -> np.ndarray[Any, np.dtype[np.float64]]:
        """The covariance of the unknowns, in products of their units; shape (n, n)."""
        return self._estimate.covariance()

    @property
    def correlation(self) -> np.ndarray[Any, np.dtype[np.float64]]:
        """The correlation of the unknowns; shape (n, n)."""
        return self._estimate.correlation()

    @property
    def engine(self) -> str:
        """How the equations were evaluated."""
        return self._estimate.engine

    @property
    def seconds(self) -> float:
        """The time that the fit took (s)."""
        return self._estimate.seconds

    def interval(self, name: str, probability: float = 0.95) -> tuple[float, float]:
        """Give the interval of an unknown that covers the truth with this probability, by Student's t.

        Raises
        ------
        Error
            If the unknown has no interval, or there is none of this name.
        """
        if name not in self.unknowns:
            raise Error(f"there is no unknown `{name}`; the fit has: {near(name, self.unknowns)}")
        found = self._estimate.interval(name, probability)
        if found is None:
            raise Error(f"`{name}` has no interval of probability {probability!r}; the printed fit says what is known of it")
        return found

    def derived(self, name: str, function: Callable[[Vector], Any]) -> Derived:
        """Compute a function of the parameters, with the interval that their covariance gives it.

        Parameters
        ----------
        name : str
            What it is called.
        function : callable
            Of the vector of parameters: ``lambda p: p.ls / p.rs``. It is read with symbols, as a model is.
        """
        value, error, interval = self._estimate.derived(name, of_parameters(self._equations, function))
        lower, upper = interval or (float("nan"), float("nan"))
        return Derived(name, value, _number(error), lower, upper)

    def to_dict(self) -> dict[str, Any]:
        """Give all that was found as dicts, lists and numbers; the JSON of ``schema/estimate.schema.json``."""
        found: dict[str, Any] = json.loads(self._estimate.to_json())
        return found

    # Frames.
    def table(self) -> Any:
        """Give a frame of the caller's kind with a row for each parameter and free initial state."""
        rows = list(self._estimate.parameters)
        known = {row[0] for row in rows}
        rows += [row for row in self._estimate.unknowns if row[0] not in known]
        return self._kind(
            {
                "name": [row[0] for row in rows],
                "value": [row[2] for row in rows],
                "unit": [row[1] for row in rows],
                "standard_error": [_number(row[4]) for row in rows],
                "lower": [_number(row[5] and row[5][0]) for row in rows],
                "upper": [_number(row[5] and row[5][1]) for row in rows],
                "index_percent": [_number(row[6]) for row in rows],
                "knowledge": [row[3] for row in rows],
            }
        )

    def predict(self, data: Any = None, /, **said: Any) -> Any:
        """Predict the outputs of a record.

        Parameters
        ----------
        data : frame or Record, optional
            Another record; free initial states are estimated from its outputs, the parameters stay. Without it, the records of the
            fit with their estimated initial states.
        **said
            Of a bare frame: `time`, `sample_time`, `columns`, `hold`, `initial`, as in :class:`Record`.

        Returns
        -------
        frame
            Of the kind that was handed over: ``t`` and the outputs; of several records, ``record`` before.
        """
        return self._predicted(data, said, lambda record, predicted, errors: predicted)

    def residuals(self, data: Any = None, /, **said: Any) -> Any:
        """Give measured less predicted outputs, as :meth:`predict` does the predictions; NaN where nothing was measured."""
        return self._predicted(data, said, lambda record, predicted, errors: errors)

    def to_dataframe(self, data: Any = None, /, **said: Any) -> Any:
        """Give time, inputs, outputs, and for each output its prediction and residual: ``id``, ``id_predicted``, ``id_residual``.

        A frame of the caller's kind, a row for each sample. The arguments are those of :meth:`predict`.
        """
        return self._predicted(data, said, self._all)

    def _all(self, record: _core.Record, predicted: dict[str, Array], errors: dict[str, Array]) -> dict[str, Array]:
        return {
            **dict(zip(named(self._equations.inputs, "inputs"), record.inputs(), strict=True)),
            **dict(zip(predicted, record.outputs(), strict=True)),
            **{f"{name}_predicted": column for name, column in predicted.items()},
            **{f"{name}_residual": column for name, column in errors.items()},
        }

    def _predicted(self, data: Any, said: Mapping[str, Any], chosen: Any, kind: Kind | None = None) -> Any:
        outputs = list(named(self._equations.outputs, "outputs"))
        cores = self._records
        if data is not None:
            record = data if isinstance(data, Record) else Record(data, **said)
            cores = [record.core(self._equations, "record", outputs=False)]
        parts: list[dict[str, Any]] = []
        for k, core in enumerate(cores):
            predicted, errors, _ = self._problem.predict(self._estimate, core, k if data is None else None)
            columns = chosen(core, dict(zip(outputs, predicted, strict=True)), dict(zip(outputs, errors, strict=True)))
            label = {"record": [core.name] * len(core)} if len(cores) > 1 else {}
            parts.append({**label, "t": core.time(), **columns})
        together = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
        return (kind or self._kind)(together)

    # Diagnoses.
    def profile(self, name: str, probability: float = 0.95) -> Profile:
        """Compute the profile of an unknown: how the cost rises as it is moved and all others are fitted again.

        Its interval follows the curvature of the model, and ends on one side only where the data say no more.

        Raises
        ------
        Error
            If no unknown has the name.
        """
        if name not in self.unknowns:
            raise Error(f"there is no unknown `{name}`; the fit has: {near(name, self.unknowns)}")
        return Profile(name, probability, self._kind, self._problem.profile(self._estimate, name, probability))

    def report(
        self,
        path: str | os.PathLike[str] | None = None,
        *,
        title: str | None = None,
        profiles: Iterable[str] = (),
    ) -> Report:
        """Make the report: residuals and their tests, identifiability, predictions with bands, all that was set.

        Parameters
        ----------
        path : path, optional
            Write it there, as ``.html``, ``.md``, ``.json`` or ``.txt``; whole or not at all.
        title : str, optional
            The heading.
        profiles : names
            Unknowns whose profiles it has, too.

        Raises
        ------
        Error
            If the path has another ending, or cannot be written to.
        """
        made = self._problem.report(self._estimate)
        report = Report(made.extended(title, [self.profile(name).to_json() for name in profiles]))
        if path is not None:
            report.save(path)
        return report

    def plot(self) -> Figure:
        """Plot measured and predicted outputs, and the inputs, over time (needs matplotlib)."""
        from greybox import plots

        return plots.response(self._plain(), self._equations)

    def plot_residuals(self) -> Figure:
        """Plot the residuals over time, their autocorrelation and their distribution (needs matplotlib)."""
        from greybox import plots

        return plots.residuals(self._plain(), self._equations)

    def _plain(self) -> dict[str, Any]:
        found: dict[str, Any] = self._predicted(None, {}, self._all, dict)
        return found

    def __str__(self) -> str:
        return str(self._estimate)

    __repr__ = __str__

    def _repr_html_(self) -> str:
        rows = ""
        for name, unit, value, knowledge, error, interval, index in self._estimate.parameters:
            cells = [name, f"{value:.6g}", unit, "" if error is None else f"{error:.2g}"]
            cells.append(knowledge if interval is None else f"{interval[0]:.6g} … {interval[1]:.6g}")
            cells.append("" if index is None else f"{index:.3g} %")
            rows += "<tr>" + "".join(f"<td>{html.escape(cell)}</td>" for cell in cells) + "</tr>"
        heads = ("parameter", "value", "unit", "std. error", "95 % interval", "index")
        head = "".join(f"<th>{one}</th>" for one in heads)
        said = "".join(f"<li>{html.escape(str(one))}</li>" for one in self.warnings)
        pictures = self._problem.report(self._estimate).pictures()
        picture = pictures[0][1] if pictures else ""
        return (
            f"<p><b>Verdict: {self.verdict}.</b> Search: {html.escape(self.outcome)}.</p>"
            f"<table><thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table>"
            f"<ul>{said}</ul>{picture}"
        )


def _number(value: float | None) -> float:
    return float("nan") if value is None else value


