"""`Profile`: how the cost rises as one unknown is moved."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from greybox.frames import Kind

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["Profile"]


class Profile:
    """The profile of one unknown, by :meth:`greybox.Fit.profile`.

    Attributes
    ----------
    name : str
        The unknown.
    probability : float
        With which the interval covers the truth.
    lower, upper : float
        The ends of the interval, in the unknown's unit; infinite where the data exclude nothing on that side.
    threshold : float
        The interval ends where the rise reaches this.
    remark : str
        What was met on the way; empty if nothing was.
    """

    def __init__(self, name: str, probability: float, kind: Kind, found: tuple[Any, ...]) -> None:
        lower, upper, self._values, self._rises, self.threshold, self.remark, self._json = found
        self.name = name
        self.probability = probability
        self.lower: float = float("-inf") if lower[0] == "open" else lower[1]
        self.upper: float = float("inf") if upper[0] == "open" else upper[1]
        self._kind = kind

    def table(self) -> Any:
        """Give the curve as a frame of the caller's kind: ``value`` and ``rise``."""
        return self._kind({"value": self._values, "rise": self._rises})

    def to_json(self) -> str:
        """Give the profile as JSON."""
        return str(self._json)

    def plot(self) -> Figure:
        """Plot the curve (needs matplotlib)."""
        from greybox import plots

        return plots.profile(self.name, self._values, self._rises, self.threshold)

    def __repr__(self) -> str:
        remark = f"; {self.remark}" if self.remark else ""
        return f"{self.name} is within {self.lower:.6g} … {self.upper:.6g} with {100 * self.probability:g} %{remark}"
