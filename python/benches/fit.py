"""Times a fit of 20,000 samples from a pandas frame, beside the part of it that is Rust and beside SciPy with numba.

Run by ``python python/benches/fit.py``, with the package, pandas, SciPy and numba installed. CPU time of the process, the median of fifteen
rounds in turn.

- ``frame to result``: `gb.fit`, with its reading of the model and of the frame.
- ``Rust``: the compiled library's part of the same fit, from a record in memory: problem, program, search, verdict. A program in Rust
  does this and no more.
- ``SciPy``: `least_squares` with residuals of the same method (Runge-Kutta 4, one step per sample) in a loop that numba has
  compiled before, the same unknowns (three parameters, two initial states) and the covariance from the last Jacobian.
"""

from __future__ import annotations

import statistics
import subprocess
import sys
import time
import warnings
from collections.abc import Callable
from typing import Any

import numba
import numpy as np
import pandas as pd
from motor import Pmsm, declared, record
from scipy.optimize import least_squares

import greybox as gb
from greybox import _core
from greybox.options import settings
from greybox.records import Record

ROUNDS = 15


@numba.njit(cache=False)
def slope(a: float, b: float, ud: float, uq: float, w: float, rs: float, ls: float, ke: float) -> tuple[float, float]:
    we = 4.0 * w
    return (ud - rs * a) / ls + we * b, (uq - rs * b - ke * w * np.sqrt(2 / 3)) / ls - we * a


@numba.njit(cache=False)
def errors(p: Any, dt: float, ud: Any, uq: Any, w: Any, id_: Any, iq: Any) -> Any:
    rs, ls, ke, a, b = p
    n = len(ud)
    out = np.empty(2 * n)
    for k in range(n):
        out[2 * k] = a - id_[k]
        out[2 * k + 1] = b - iq[k]
        a1, b1 = slope(a, b, ud[k], uq[k], w[k], rs, ls, ke)
        a2, b2 = slope(a + dt / 2 * a1, b + dt / 2 * b1, ud[k], uq[k], w[k], rs, ls, ke)
        a3, b3 = slope(a + dt / 2 * a2, b + dt / 2 * b2, ud[k], uq[k], w[k], rs, ls, ke)
        a4, b4 = slope(a + dt * a3, b + dt * b3, ud[k], uq[k], w[k], rs, ls, ke)
        a += dt / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
        b += dt / 6 * (b1 + 2 * b2 + 2 * b3 + b4)
    return out


def scipys(frame: pd.DataFrame) -> np.ndarray[Any, np.dtype[np.float64]]:
    columns = [frame[name].to_numpy() for name in ("ud", "uq", "w", "id", "iq")]
    dt = float(frame["t"].iloc[1] - frame["t"].iloc[0])
    begin = np.array([1.0, 2e-3, 0.7, columns[3][0], columns[4][0]])
    found = least_squares(errors, begin, x_scale=np.abs(begin) + 0.01, args=(dt, *columns))
    jacobian = found.jac
    np.linalg.inv(jacobian.T @ jacobian) * 2 * found.cost / (len(found.fun) - 5)
    return np.asarray(found.x)


def timed(work: Callable[[], Any]) -> float:
    begin = time.process_time()
    work()
    return time.process_time() - begin


def fresh(program: str) -> float:
    """The median of seven fresh interpreters, in seconds of CPU."""
    text = f"import time; b = time.process_time(); {program}; print(time.process_time() - b)"
    runs = [float(subprocess.run([sys.executable, "-c", text], capture_output=True, text=True, check=True).stdout) for _ in range(7)]
    return statistics.median(runs)


FIRST_FIT = (
    "import greybox as gb, numpy as np; t = np.arange(2000) * 0.01; u = np.sign(np.sin(t)); "
    "m = gb.model(lambda t, x, u, p: [p.k * (u.u - x.y)], states=['y'], inputs=['u'], outputs=['y'], parameters=['k']); "
    "r = gb.simulate(m, {'t': t, 'u': u}, parameters={'k': 0.5}, noise={'y': 0.01}); gb.fit(m, r, k=gb.free(1.0))"
)


def main() -> None:
    warnings.simplefilter("ignore")
    frame = record(20_000)
    model = Pmsm(4)
    equations = model.equations()
    core, chosen = Record(frame).core(equations, "record"), settings(equations, {})
    parameters = list(declared().values())
    work: dict[str, Callable[[], Any]] = {
        "frame to result": lambda: gb.fit(model, frame, **declared()),
        "Rust": lambda: _core.Problem(equations.core, [core], parameters, chosen).run(None),
        "SciPy with numba": lambda: scipys(frame),
    }
    ours = gb.fit(model, frame, **declared())
    theirs = scipys(frame)
    print("rs, ls, ke:", [ours.parameters[name] for name in ours.parameters], theirs[:3].tolist())
    times: dict[str, list[float]] = {name: [] for name in work}
    for _ in range(ROUNDS):
        for name, one in work.items():
            times[name].append(timed(one))
    medians = {name: statistics.median(all_) for name, all_ in times.items()}
    for name, median in medians.items():
        print(f"{name}: {1e3 * median:.1f} ms")
    print(f"frame to result / Rust: {medians['frame to result'] / medians['Rust']:.2f}")
    print(f"SciPy / frame to result: {medians['SciPy with numba'] / medians['frame to result']:.1f}")
    print(f"import: {fresh('import greybox'):.2f} s, NumPy's part {fresh('import numpy'):.2f} s")
    print(f"import to first fit: {fresh(FIRST_FIT):.2f} s")


if __name__ == "__main__":
    main()
