"""The settings of a fit, from how they are written to how the compiled library takes them."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from typing import Any, Literal, TypeAlias, TypedDict

from greybox.checks import flag, mapping, number, path, text, whole
from greybox.errors import Error
from greybox.model import Equations, of_sample
from greybox.signals import Signals, named, near

__all__ = ["Noise", "Options", "by_name", "settings"]

#: What is said of the noise of the outputs: standard deviations by name, or that the covariance of all is estimated.
Noise: TypeAlias = "Mapping[str, float] | Literal['covariance']"

_LEVEL = "a standard deviation"


def by_name(what: str, given: Mapping[str, float] | None, signals: Signals, wanted: str) -> dict[str, float]:
    """Give a number of each quantity that has one, in order; without a mapping of none.

    Raises
    ------
    Error
        If what is given is no mapping to numbers, or names what there is not.
    """
    first = next(iter(signals), "name")
    each = mapping(what, given, f'{wanted} for each by its name: {{"{first}": 0.1}}')
    for name in each:
        if name not in signals:
            raise Error(f"{what} names `{name}`, and the model has: {near(name, signals)}")
    return {name: number(f"`{name}` of {what}", each[name]) for name in signals if name in each}


def _levels(what: str, given: Mapping[str, float] | None, signals: Signals) -> list[tuple[str, float]] | None:
    return None if given is None else list(by_name(what, given, signals, _LEVEL).items())


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
    if noise is not None and not isinstance(noise, str):
        # Of outputs that are left out, that of a model file stays.
        noise = {**(defaults.get("noise") or {}), **by_name("noise", noise, outputs, _LEVEL)}
    predictor = (text("predictor", given.get("predictor")) or "").partition(":")[0].strip()
    if predictor in ("kalman", "second-order"):
        if chosen:
            raise Error(f"noise={chosen!r} has no effect on the predictor {predictor}, a filter: it takes `noise` of the model")
        noise = None
    if starts is not None:
        starts = whole("starts", starts, 1)
    staged, shooting = flag("staged", given.get("staged")), flag("multiple_shooting", given.get("multiple_shooting"))
    if staged and shooting:
        raise Error("staged and multiple_shooting are both asked for; take one: a staged fit shoots by itself where it helps")
    weighting, checkpoint, limit = given.get("weighting"), given.get("checkpoint"), given.get("time_limit")
    names = ("loss", "prefilter", "integrator", "predictor", "optimizer")
    return {
        "noise": None if isinstance(noise, str) else _levels("noise", noise, outputs),
        "noise_covariance": noise == "covariance",
        "input_noise": _levels("input_noise", given.get("input_noise"), inputs),
        "weighting": None if weighting is None else of_sample(equations, weighting),
        "starts": starts,
        "staged": staged,
        "multiple_shooting": shooting,
        "time_limit": None if limit is None else number("time_limit", limit),
        "checkpoint": None if checkpoint is None else (path("checkpoint", checkpoint), 1),
        **{name: text(name, given.get(name)) for name in names},
    }
