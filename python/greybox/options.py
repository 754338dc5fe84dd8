"""The settings of a fit, from how they are written to how the compiled library takes them."""

from __future__ import annotations

import operator
import os
from collections.abc import Callable, Mapping
from typing import Any, Literal, TypeAlias, TypedDict

from greybox.errors import Error
from greybox.model import Equations, of_sample
from greybox.signals import Signals, named, near

__all__ = ["Noise", "Options", "settings", "whole"]

#: What is said of the noise of the outputs: standard deviations by name, or that the covariance of all is estimated.
Noise: TypeAlias = "Mapping[str, float] | Literal['covariance']"


def _name(what: str, text: str | None) -> str | None:
    if text is not None and not isinstance(text, str):
        raise Error(f"{what} is {text!r}; give its name as text")
    return text


def _levels(what: str, given: Mapping[str, float] | None, signals: Signals) -> list[tuple[str, float]] | None:
    if given is None:
        return None
    if not isinstance(given, Mapping):
        first = next(iter(signals), "name")
        raise Error(f'{what} is {given!r}; give a standard deviation for each by its name: {{"{first}": 0.1}}')
    for name in given:
        if name not in signals:
            raise Error(f"{what} names `{name}`, and the model has: {near(name, signals)}")
    return [(name, float(given[name])) for name in signals if name in given]


def whole(what: str, value: Any, least: int) -> int:
    """Give a whole number, also one of NumPy.

    Raises
    ------
    Error
        If it is none, or less than `least`.
    """
    try:
        number = operator.index(value)
    except TypeError:
        number = least - 1
    if number < least:
        raise Error(f"{what} is {value!r}; take a whole number of {least} or more")
    return number


class Options(TypedDict, total=False):
    """The options of a fit, as :func:`greybox.fit` describes them."""

    noise: Noise | None
    input_noise: Mapping[str, float] | None
    loss: str | None
    weighting: Callable[..., Any] | None
    prefilter: str | None
    integrator: str | None
    predictor: str | None
    optimizer: str | None
    starts: int | None
    staged: bool | None
    multiple_shooting: bool | None
    time_limit: float | None
    checkpoint: str | os.PathLike[str] | None


def settings(equations: Equations, given: Options) -> dict[str, Any]:
    """Give the options as the compiled library takes them; those that are not given are the model's."""
    defaults = equations.defaults()
    chosen = given.get("noise")
    given = Options(**{**defaults, **{name: value for name, value in given.items() if value is not None}})  # type: ignore[typeddict-item]
    inputs, outputs = named(equations.inputs, "inputs"), named(equations.outputs, "outputs")
    noise, starts = given.get("noise"), given.get("starts")
    if isinstance(noise, str) and noise != "covariance":
        raise Error(f'noise is {noise!r}; give a standard deviation for each output, {{"name": 0.1}}, or "covariance"')
    if isinstance(noise, Mapping):
        # Of outputs that are left out, that of a model file stays.
        noise = {**(defaults.get("noise") or {}), **noise}
    predictor = str(given.get("predictor") or "").partition(":")[0].strip()
    if predictor in ("kalman", "second-order"):
        if chosen:
            raise Error(f"noise={chosen!r} has no effect on the predictor {predictor}, a filter: it takes `noise` of the model")
        noise = None
    if starts is not None:
        starts = whole("starts", starts, 1)
    if given.get("staged") and given.get("multiple_shooting"):
        raise Error("staged and multiple_shooting are both asked for; take one: a staged fit shoots by itself where it helps")
    weighting, checkpoint = given.get("weighting"), given.get("checkpoint")
    names = ("loss", "prefilter", "integrator", "predictor", "optimizer")
    return {
        "noise": None if isinstance(noise, str) else _levels("noise", noise, outputs),
        "noise_covariance": noise == "covariance",
        "input_noise": _levels("input_noise", given.get("input_noise"), inputs),
        "weighting": None if weighting is None else of_sample(equations, weighting),
        "starts": starts,
        "staged": bool(given.get("staged")),
        "multiple_shooting": bool(given.get("multiple_shooting")),
        "time_limit": given.get("time_limit"),
        "checkpoint": None if checkpoint is None else (os.fspath(checkpoint), 1),
        **{name: _name(name, given.get(name)) for name in names},  # type: ignore[arg-type]
    }
