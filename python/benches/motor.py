"""What the benchmarks fit: a motor and records of it."""

from __future__ import annotations

import numpy as np
import pandas as pd

import greybox as gb

TRUTH = {"rs": 0.63, "ls": 4e-3, "ke": 0.95}
SAMPLE_TIME = 0.126e-3


class Pmsm(gb.Model):
    states = gb.signals(id="A", iq="A")
    inputs = gb.signals(ud="V", uq="V", w="rad/s")
    outputs = states
    parameters = gb.signals(rs="ohm", ls="H", ke="V s/rad")

    def __init__(self, pole_pairs: int) -> None:
        self.pole_pairs = pole_pairs

    def derivative(self, t: gb.Symbol, x: gb.Vector, u: gb.Vector, p: gb.Vector) -> gb.Vector:
        we = self.pole_pairs * u.w
        return x.like(
            id=(u.ud - p.rs * x.id) / p.ls + we * x.iq,
            iq=(u.uq - p.rs * x.iq - p.ke * u.w * gb.sqrt(2 / 3)) / p.ls - we * x.id,
        )


def declared() -> dict[str, gb.Parameter]:
    """Where the searches start."""
    return {"rs": gb.free(1.0, within=(0.01, 10)), "ls": gb.free(2e-3), "ke": gb.free(0.7)}


def record(samples: int, seed: int = 1) -> pd.DataFrame:
    """A drive whose voltages jump and whose speed swings, with noise of 0.05 A."""
    random = np.random.default_rng(seed)
    t = np.arange(samples) * SAMPLE_TIME
    steps = -(-samples // 100)
    frame = pd.DataFrame(
        {
            "t": t,
            "ud": np.repeat(random.uniform(-5, 5, steps), 100)[:samples],
            "uq": np.repeat(random.uniform(30, 50, steps), 100)[:samples],
            "w": 50 + 5 * np.sin(20 * t),
        }
    )
    made = gb.simulate(Pmsm(4), frame, parameters=TRUTH, noise={"id": 0.05, "iq": 0.05}, seed=seed, integrator="rk4:2")
    assert isinstance(made, pd.DataFrame)
    return made


def fleet(motors: int, samples: int = 2000) -> pd.DataFrame:
    """Records of many motors, one below the other."""
    return pd.concat([record(samples, seed).assign(motor=seed) for seed in range(motors)], ignore_index=True)
