"""The settings of a fit, from how they are written to how the compiled library takes them."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Any, Literal, TypeAlias

from greybox.errors import Error
from greybox.signals import Signals, near

__all__ = ["Noise", "options"]

#: What is said of the noise of the outputs: a standard deviation for each, or that the covariance of all is estimated.
Noise: TypeAlias = "Mapping[str, float] | Literal['covariance']"


def _named(what: str, text: str | None) -> tuple[str, list[float]] | None:
    """Take ``"huber:1.345"`` apart."""
    if text is None:
        return None
    if not isinstance(text, str):
        raise Error(f"{what} is {text!r}; give its name as text")
    name, *numbers = text.split(":")
    try:
        return name, [float(number) for number in numbers]
    except ValueError:
        raise Error(f"{what} is {text!r}; after the name and a colon there are numbers, as in \"huber:1.345\"") from None


def _levels(what: str, given: Mapping[str, float] | None, signals: Signals) -> list[float] | None:
    if given is None:
        return None
    for name in given:
        if name not in signals:
            raise Error(f"{what} names `{name}`, and the model has: {near(name, signals)}")
    missing = [name for name in signals if name not in given]
    if missing:
        raise Error(f"{what} lacks `{missing[0]}`; give a standard deviation for each of {', '.join(signals)}")
    return [float(given[name]) for name in signals]


def options(
    inputs: Signals,
    outputs: Signals,
    *,
    noise: Noise | None = None,
    input_noise: Mapping[str, float] | None = None,
    loss: str | None = None,
    prefilter: str | None = None,
    integrator: str | None = None,
    predictor: str | None = None,
    starts: int | None = None,
    time_limit: float | None = None,
    checkpoint: str | os.PathLike[str] | None = None,
) -> dict[str, Any]:
    """Give the settings by the names of the compiled library."""
    if isinstance(noise, str) and noise != "covariance":
        raise Error(f'noise is {noise!r}; give a standard deviation for each output, {{"name": 0.1}}, or "covariance"')
    if starts is not None and (not isinstance(starts, int) or starts < 1):
        raise Error(f"starts is {starts!r}; take a whole number of 1 or more")
    return {
        "noise": None if isinstance(noise, str) else _levels("noise", noise, outputs),
        "noise_covariance": noise == "covariance",
        "input_noise": _levels("input_noise", input_noise, inputs),
        "loss": _named("loss", loss),
        "prefilter": _named("prefilter", prefilter),
        "integrator": _named("integrator", integrator),
        "predictor": _named("predictor", predictor),
        "starts": starts,
        "time_limit": time_limit,
        "checkpoint": None if checkpoint is None else (os.fspath(checkpoint), 1),
    }
