"""Declarations of parameters."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from greybox._core import Parameter
from greybox.checks import flag, mapping, number, shown
from greybox.errors import Error
from greybox.model import Equations
from greybox.signals import Signals, distinct, named, near

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
    flags = (flag("log", log), flag("positive", positive), flag("per_experiment", per_experiment))
    return Parameter(number("start", start), True, _pair("within", within), _pair("prior", prior), *flags)


def fixed(value: float) -> Parameter:
    """Declare a quantity that keeps its value."""
    return Parameter(number("the value of gb.fixed", value), False)


def _pair(what: str, given: Any) -> tuple[float, float] | None:
    if given is None:
        return None
    try:
        first, second = given
    except (TypeError, ValueError):
        raise Error(f"{what} is {shown(given)}; give two numbers: {what}=(0.1, 10.0)") from None
    return number(f"the first number of {what}", first), number(f"the second number of {what}", second)


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
        raise Error(f"{what} {shown(given)}: give the declaration of each by its name")
    for name, value in given.items():
        if name not in names:
            raise Error(f"there is no {what} `{name}`; the model has: {near(name, names)}")
        if not isinstance(value, Parameter):
            told = f"{value!r}" if isinstance(value, (int, float)) else type(value).__name__
            raise Error(f"{what} `{name}` is {told}; write gb.free({told}) to estimate it from there, or gb.fixed({told}) to keep it")
    return [given.get(name) for name in names]


def together(parameters: Mapping[str, Parameter] | None, by_name: Mapping[str, Parameter], options: Iterable[str]) -> dict[str, Parameter]:
    """Give the declarations of a mapping and those by name, which may be misspelled options.

    Raises
    ------
    Error
        If a parameter is declared twice, or what stands by name is no declaration.
    """
    given = dict(mapping("parameters", parameters, "the declaration of each by its name"))
    for name, value in by_name.items():
        if name in given:
            raise Error(f"parameter `{name}` is declared twice, in parameters and by name; leave one out")
        if not isinstance(value, (Parameter, int, float)):
            raise Error(f"there is no option `{name}`, and {type(value).__name__} declares no parameter; options are: {near(name, options)}")
        given[name] = value
    return given


def check_labels(of: Equations, given: Sequence[Parameter], records: Sequence[str]) -> None:
    """Refuse parameters with the name that an unknown of one of several records has: its own parameter, or its initial state.

    Raises
    ------
    Error
        If there is one.
    """
    parameters = named(of.parameters, "parameters")
    own = [name for name, one in zip(parameters, given, strict=True) if one.per_experiment]
    initial = [f"{name}(0)" for name in named(of.states, "states")]
    labels = {f"{name} [{record}]" for name in [*own, *initial] for record in distinct(records)} if len(records) > 1 else set[str]()
    for name in parameters:
        if name in labels:
            raise Error(f"parameter `{name}` has the name of an unknown of one record; rename the parameter, or give gb.Record another name")
