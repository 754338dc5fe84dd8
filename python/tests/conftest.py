"""A motor, its record and its fit."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import greybox as gb

DATA = Path(os.environ.get("GREYBOX_DATA", Path(__file__).parents[2] / "examples" / "data"))


class Pmsm(gb.Model):
    """The motor of the README."""

    states = gb.signals(id="A", iq="A")
    inputs = gb.signals(ud="V", uq="V", w="rad/s")
    outputs = states
    parameters = gb.signals(rs="ohm", ls="H", ke="V s/rad")

    def __init__(self, pole_pairs: float) -> None:
        self.pole_pairs = pole_pairs

    def derivative(self, t: gb.Symbol, x: gb.Vector, u: gb.Vector, p: gb.Vector) -> gb.Vector:
        we = u.w * self.pole_pairs
        return x.like(
            id=(u.ud - p.rs * x.id) / p.ls + we * x.iq,
            iq=(u.uq - p.rs * x.iq - p.ke * u.w * gb.sqrt(2 / 3)) / p.ls - we * x.id,
        )


def cooling() -> gb.Model:
    """A body that cools down."""
    return gb.model(
        lambda t, x, u, p: [p.k * (u.room - x.body)],
        states={"body": "K"},
        inputs={"room": "K"},
        outputs={"body": "K"},
        parameters={"k": "1/s"},
    )


def cooled(n: int = 200, k: float = 0.3, sigma: float = 0.05, seed: int = 1) -> dict[str, Any]:
    """A record of it, in a room that is heated and not heated."""
    t = np.arange(n) * 0.1
    room = 20 + 10 * np.sign(np.sin(0.9 * t))
    body = np.full(n, 80.0)
    for i in range(n - 1):
        body[i + 1] = room[i] + (body[i] - room[i]) * np.exp(-k * 0.1)
    return {"t": t, "room": room, "body": body + np.random.default_rng(seed).normal(0.0, sigma, n)}


@pytest.fixture(scope="session")
def motor() -> pd.DataFrame:
    return pd.read_csv(DATA / "pmsm.csv")


@pytest.fixture(scope="session")
def declared() -> dict[str, gb.Parameter]:
    return {"rs": gb.free(1.0, within=(0.01, 10)), "ls": gb.free(2e-3), "ke": gb.free(0.7)}


@pytest.fixture(scope="session")
def fitted(motor: pd.DataFrame, declared: dict[str, gb.Parameter]) -> gb.Fit:
    return gb.fit(Pmsm(4), motor, **declared)


@pytest.fixture
def read() -> Callable[..., Any]:
    """Read one expression of a state `x`, an input `u` and a parameter `p` and evaluate it, by a simulation of one output."""

    def evaluate(expression: Callable[[Any, Any, Any], Any], x: float, u: float = 0.0, p: float = 0.0) -> float:
        model = gb.model(
            next=lambda t, x, u, p: [x.x],
            output=lambda t, x, u, p: [expression(x.x, u.u, p.p)],
            states=["x"],
            inputs=["u"],
            outputs=["y"],
            parameters=["p"],
        )
        found = gb.simulate(model, {"t": [0.0, 1.0], "u": [u, u]}, parameters={"p": p}, initial={"x": x})
        return float(found["y"][0])

    return evaluate
