"""A user's program, whose types mypy and pyright check in strict mode; it is run, too."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

import greybox as gb


class Pmsm(gb.Model):
    states = gb.signals(id="A", iq="A")
    inputs = gb.signals(ud="V", uq="V", w="rad/s")
    outputs = states
    parameters = gb.signals(rs="ohm", ls="H", ke="V s/rad")

    def __init__(self, pole_pairs: int) -> None:
        self.pole_pairs = pole_pairs

    def derivative(self, t: gb.Symbol, x: gb.Vector, u: gb.Vector, p: gb.Vector) -> gb.Vector:
        we = self.pole_pairs * u.w
        drop = np.array([p.rs * x.id, p.rs * x.iq])
        return x.like(
            id=(u.ud - drop[0]) / p.ls + we * x.iq,
            iq=(u.uq - drop[1] - p.ke * u.w * np.sqrt(2 / 3)) / p.ls - we * x.id,
        )


def main(path: Path) -> gb.Fit:
    frame = pd.read_csv(path)
    fit = gb.fit(Pmsm(4), frame, rs=gb.free(1.0, within=(0.01, 10)), ls=gb.free(2e-3), ke=gb.free(0.7))
    rs: float = fit.parameters.rs
    lower, upper = fit.interval("rs")
    assert lower < rs < upper and fit.verdict == "usable"
    profile: gb.Profile = fit.profile("rs")
    assert profile.lower < rs < profile.upper
    return fit


if __name__ == "__main__":
    print(main(Path(__file__).parents[2] / "examples" / "data" / "pmsm.csv"))
