"""`Bootstrap`: how estimates scatter over refits of resampled records."""

from __future__ import annotations

import json
from typing import Any, TypeAlias

from greybox.errors import Error
from greybox.frames import Kind
from greybox.signals import near

__all__ = ["Bootstrap"]

#: Standard errors, biases, intervals, refits that were tried, those that ended, and JSON.
Found: TypeAlias = "tuple[list[float], list[float], list[tuple[float, float]], int, int, str]"


class Bootstrap:
    """Refits of what the model could as well have measured, by :meth:`greybox.Fit.bootstrap`.

    Attributes
    ----------
    unknowns : list of str
        The free quantities, initial states too.
    tried, converged : int
        Refits begun, fewer than asked for where a time limit ended them, and those that ended; the others are left out.
    seed : int
        The seed that makes the same again.
    colored : bool
        Whether single residuals were drawn although they are colored: the intervals are too narrow.
    """

    def __init__(self, unknowns: list[str], values: list[float], seed: int, kind: Kind, found: Found) -> None:
        self.unknowns = unknowns
        self.seed = seed
        self._values = values
        self._kind = kind
        self._errors, self._bias, self._intervals, self.tried, self.converged, self._json = found
        self.colored: bool = json.loads(self._json)["colored"]

    def interval(self, name: str) -> tuple[float, float]:
        """Give the 95 % interval of an unknown: percentiles of the refits, stretched for the degrees of freedom that residuals have lost.

        Raises
        ------
        Error
            If no unknown has the name.
        """
        return self._intervals[self._place(name)]

    def standard_error(self, name: str) -> float:
        """Give the standard deviation of an unknown over the refits.

        Raises
        ------
        Error
            If no unknown has the name.
        """
        return self._errors[self._place(name)]

    def _place(self, name: str) -> int:
        if name not in self.unknowns:
            raise Error(f"there is no unknown `{name}`; the fit has: {near(name, self.unknowns)}")
        return self.unknowns.index(name)

    def table(self) -> Any:
        """Give a frame of the caller's kind with a row for each unknown; ``bias`` is the mean over the refits less the estimate."""
        return self._kind(
            {
                "name": self.unknowns,
                "value": self._values,
                "standard_error": self._errors,
                "bias": self._bias,
                "lower": [lower for lower, _ in self._intervals],
                "upper": [upper for _, upper in self._intervals],
            }
        )

    def to_json(self) -> str:
        """Give the result as JSON."""
        return self._json

    def __repr__(self) -> str:
        width = max(map(len, self.unknowns))
        rows = (
            f"{name:<{width}}  {value:.6g}  +- {error:.2g}  {lower:.6g} … {upper:.6g}"
            for name, value, error, (lower, upper) in zip(self.unknowns, self._values, self._errors, self._intervals, strict=True)
        )
        return f"{self.converged} of {self.tried} refits ended; seed {self.seed}\n" + "\n".join(rows)
