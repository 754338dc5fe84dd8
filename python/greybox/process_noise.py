"""`ProcessNoise`: whether records show that the plant is disturbed."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["ProcessNoise"]


@dataclass(frozen=True)
class ProcessNoise:
    """The likelihood-ratio test of the hypothesis that nothing disturbs the plant, by :meth:`greybox.Fit.process_noise`.

    Attributes
    ----------
    levels : list of str
        The unknowns that are levels of process noise, and zero without it.
    likelihood_ratio : float
        Twice the difference of the log-likelihoods with process noise and without.
    degrees_of_freedom : int
        The number of levels.
    p_value : float
        Probability of such a ratio, or a larger one, without process noise.
    """

    levels: list[str]
    likelihood_ratio: float
    degrees_of_freedom: int
    p_value: float
