"""Bad starts for problems of NIST, and what SciPy makes of them.

    python starts.py FOLDER_OF_DAT FOLDER_OF_STARTS [SEED]      needs numpy and scipy

Draws 100 starts of each kind around start 1 of each file, each seeded by (SEED, problem, kind), and writes them to
FOLDER_OF_STARTS/PROBLEM_KIND.txt, a start a row. The kinds: 10 and 100, each parameter log-uniform within that factor;
sign, as 10 with every sign drawn; zero, as 10 with one parameter at zero. Prints what curve_fit (MINPACK's lmder with
differences, maxfev 1e5) ends with: right (sum of squares within 1e-4 of the certified one), said (an exception), infinite
(covariance), silent (wrong without a word), and milliseconds of CPU time a fit.
"""
import os
import re
import sys
import time
import warnings

import numpy as np
from numpy import exp
from scipy.optimize import curve_fit

warnings.simplefilter("ignore")
MODELS = {
    "BoxBOD": lambda x, a, b: a * (1 - exp(-b * x)),
    "MGH09": lambda x, a, b, c, d: a * (x * x + x * b) / (x * x + x * c + d),
    "MGH10": lambda x, a, b, c: a * exp(b / (x + c)),
    "Eckerle4": lambda x, a, b, c: a / b * exp(-0.5 * ((x - c) / b) ** 2),
    "Bennett5": lambda x, a, b, c: a * (b + x) ** (-1 / c),
    "Thurber": lambda x, a, b, c, d, e, f, g: (a + x * (b + x * (c + x * d))) / (1 + x * (e + x * (f + x * g))),
    "Rat43": lambda x, a, b, c, d: a / (1 + exp(b - c * x)) ** (1 / d),
    "Lanczos3": lambda x, a, b, c, d, e, f: a * exp(-b * x) + c * exp(-d * x) + e * exp(-f * x),
    "ENSO": lambda x, a, b, c, d, e, f, g, h, i: a + b * np.cos(2 * np.pi * x / 12) + c * np.sin(2 * np.pi * x / 12)
    + e * np.cos(2 * np.pi * x / d) + f * np.sin(2 * np.pi * x / d)
    + h * np.cos(2 * np.pi * x / g) + i * np.sin(2 * np.pi * x / g),
}


def load(path):
    text = open(path).read()
    rows = [r.split() for r in re.findall(r"^\s*b\d+\s*=\s*(.*)$", text, re.M)]
    data = [[float(w) for w in line.split()] for line in text.rsplit("\nData:", 1)[1].splitlines()[1:] if len(line.split()) > 1]
    data = np.array(data)
    return np.array([float(r[0]) for r in rows]), np.array([float(r[2]) for r in rows]), data[:, 1], data[:, 0]


def draw(kind, start, rng):
    factor = {"10": 10, "100": 100}.get(kind, 10)
    starts = start * factor ** rng.uniform(-1, 1, (100, len(start)))
    if kind == "sign":
        starts *= rng.choice([-1.0, 1.0], starts.shape)
    if kind == "zero":
        starts[np.arange(100), rng.integers(0, len(start), 100)] = 0.0
    return starts


def main(folder, starts_folder, seed):
    os.makedirs(starts_folder, exist_ok=True)
    for k, (name, model) in enumerate(MODELS.items()):
        start, certified, x, y = load(os.path.join(folder, name + ".dat"))
        best = ((model(x, *certified) - y) ** 2).sum()
        for kind, number in {"10": 10, "100": 100, "sign": 1, "zero": 0}.items():
            starts = draw(kind, start, np.random.default_rng([seed, k, number]))
            np.savetxt(os.path.join(starts_folder, f"{name}_{kind}.txt"), starts, fmt="%.17g")
            tally, begin = dict(right=0, said=0, infinite=0, silent=0), time.process_time()
            for s in starts:
                try:
                    p, covariance = curve_fit(model, x, y, p0=s, maxfev=100_000)
                except (RuntimeError, ValueError):
                    tally["said"] += 1
                    continue
                if ((model(x, *p) - y) ** 2).sum() <= best * (1 + 1e-4) + 1e-22:
                    tally["right"] += 1
                else:
                    tally["silent" if np.isfinite(covariance).all() else "infinite"] += 1
            milliseconds = (time.process_time() - begin) * 10
            print(f"{name:9} {kind:>4}", tally, f"{milliseconds:.2f} ms/fit", flush=True)


main(sys.argv[1], sys.argv[2], int(sys.argv[3]) if len(sys.argv) > 3 else 1)
