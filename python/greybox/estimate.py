"""`Estimate`: what a fit found, as numbers and as a table."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from greybox import _core
from greybox.checks import number, text
from greybox.errors import Error, FitWarning
from greybox.frames import Kind
from greybox.model import Equations, of_parameters
from greybox.signals import Values, Vector, named, near

__all__ = ["VERDICTS", "Derived", "Estimate"]


@dataclass(frozen=True)
class Derived:
    """A quantity that was computed from the parameters, with its standard error and 95 % interval; NaN where there is none."""

    name: str
    value: float
    standard_error: float
    lower: float
    upper: float


VERDICTS = {"usable": "usable", "usable_with_care": "usable with care", "not_usable": "not usable"}


class Estimate:
    """The numbers of a :class:`greybox.Fit`."""

    _equations: Equations
    _estimate: _core.Estimate
    _kind: Kind

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
    def log_likelihood(self) -> float | None:
        """The logarithm of the likelihood; of a filter with a loss, with the loss of each innovation in place of half its square, as CTSM has it.

        None where weights, or a loss without a filter, make the cost no likelihood.
        """
        return self._estimate.log_likelihood

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
        if text("name", name) not in self.unknowns:
            raise Error(f"there is no unknown `{name}`; the fit has: {near(name, self.unknowns)}")
        found = self._estimate.interval(name, number("probability", probability))
        if found is None:
            raise Error(f"`{name}` has no interval of probability {probability!r}; the printed fit says what is known of it")
        return found

    def derived(self, name: str, function: Callable[[Vector], Any], record: str | None = None) -> Derived:
        """Compute a function of the parameters, with the interval that their covariance gives it.

        Parameters
        ----------
        name : str
            What it is called.
        function : callable
            Of the vector of parameters: ``lambda p: p.ls / p.rs``. It is read with symbols, as a model is.
        record : str, optional
            The name of the record whose parameters they are, where each has its own.

        Raises
        ------
        Error
            Where each record has parameters of its own, and no record of the fit is named.
        """
        names = [row[0] for row in self._estimate.experiments]
        own = [self._estimate.parameters[j][0] for j in self._estimate.own_parameters]
        if own and len(names) > 1 and record not in names:
            raise Error(f"`{own[0]}` has a value for each record: say which by record=; there are {', '.join(names)}")
        at = names.index(record) if record in names else 0
        value, error, interval = self._estimate.derived(at, text("name", name) or "", of_parameters(self._equations, function))
        lower, upper = interval or (float("nan"), float("nan"))
        return Derived(name, value, _number(error), lower, upper)

    def to_dict(self) -> dict[str, Any]:
        """Give all that was found as dicts, lists and numbers; the JSON of ``schema/estimate.schema.json``."""
        found: dict[str, Any] = json.loads(self._estimate.to_json())
        return found

    def table(self) -> Any:
        """Give a frame of the caller's kind with a row for each parameter and free initial state."""
        # Of parameters that each record has for itself, the unknowns have a row for each.
        own = set(self._estimate.own_parameters)
        rows = [row for j, row in enumerate(self._estimate.parameters) if j not in own]
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


def _number(value: float | None) -> float:
    return float("nan") if value is None else value


