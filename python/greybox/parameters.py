"""Declarations of parameters."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from greybox._core import Parameter
from greybox.errors import Error
from greybox.signals import Signals, near

__all__ = ["Parameter", "fixed", "free"]


def free(
    start: float,
    *,
    within: tuple[float, float] | None = None,
    prior: tuple[float, float] | None = None,
    log: bool = False,
    positive: bool = False,
    per_experiment: bool = False,
) -> Parameter:
    """Declare a quantity that is estimated.

    Parameters
    ----------
    start : float
        Where the search starts, in the quantity's unit.
    within : (float, float), optional
        Lower and upper bound; ``float("-inf")`` and ``float("inf")`` stand for none.
    prior : (float, float), optional
        Mean and standard deviation of knowledge from elsewhere, which counts as one more measurement.
    log : bool
        Estimate the logarithm: for positive quantities that are known to a factor rather than to a difference.
    positive : bool
        Only a positive value has a meaning: an estimate that is not positive is then not usable. The search is not bounded.
    per_experiment : bool
        Each record has a value of its own.

    Examples
    --------
    >>> import greybox as gb
    >>> gb.free(1.0, within=(0.01, 10))
    free(1.0, within=(0.01, 10.0))
    """
    return Parameter(start, True, within, prior, log, positive, per_experiment)


def fixed(value: float) -> Parameter:
    """Declare a quantity that keeps its value."""
    return Parameter(value, False)


def declared(given: Mapping[str, Any], names: Signals, what: str = "parameter") -> list[Parameter]:
    """Give the declaration of each quantity, in order.

    Raises
    ------
    Error
        If one is missing, unknown, or not declared by :func:`free` or :func:`fixed`.
    """
    found = said(given, names, what)
    missing = [name for name in names if name not in given]
    if missing:
        raise Error(f"{what} `{missing[0]}` is not declared; write {missing[0]}=gb.free(start) to estimate it, or gb.fixed(value)")
    return [one for one in found if one is not None]


def said(given: Mapping[str, Any], names: Signals, what: str) -> list[Parameter | None]:
    """Give the declaration of each quantity that has one, in order.

    Raises
    ------
    Error
        If one is unknown, or not declared by :func:`free` or :func:`fixed`.
    """
    if not isinstance(given, Mapping):
        raise Error(f"{what} {given!r}: give the declaration of each by its name")
    for name, value in given.items():
        if name not in names:
            raise Error(f"there is no {what} `{name}`; the model has: {near(name, names)}")
        if not isinstance(value, Parameter):
            shown = f"{value!r}" if isinstance(value, (int, float)) else type(value).__name__
            raise Error(f"{what} `{name}` is {shown}; write gb.free({shown}) to estimate it from there, or gb.fixed({shown}) to keep it")
    return [given.get(name) for name in names]


def together(parameters: Mapping[str, Parameter] | None, by_name: Mapping[str, Parameter], options: Iterable[str]) -> dict[str, Parameter]:
    """Give the declarations of a mapping and those by name, which may be misspelled options.

    Raises
    ------
    Error
        If a parameter is declared twice, or what stands by name is no declaration.
    """
    given = dict(parameters or {})
    for name, value in by_name.items():
        if name in given:
            raise Error(f"parameter `{name}` is declared twice, in parameters and by name; leave one out")
        if not isinstance(value, (Parameter, int, float)):
            raise Error(f"there is no option `{name}`, and {type(value).__name__} declares no parameter; options are: {near(name, options)}")
        given[name] = value
    return given
