"""Nonlinear grey-box parameter estimation: from the equations of a system and a record of it to its parameters.

Write the state equations once, hand over a frame, get the physical parameters with a statement of how well they are known::

    import greybox as gb


    class Pmsm(gb.Model):
        states = gb.signals(id="A", iq="A")
        inputs = gb.signals(ud="V", uq="V", w="rad/s")
        outputs = states
        parameters = gb.signals(rs="ohm", ls="H", ke="V s/rad")

        def __init__(self, np):
            self.np = np

        def derivative(self, t, x, u, p):
            we = self.np * u.w
            return x.like(
                id=(u.ud - p.rs * x.id) / p.ls + we * x.iq,
                iq=(u.uq - p.rs * x.iq - p.ke * u.w * gb.sqrt(2 / 3)) / p.ls - we * x.id,
            )


    fit = gb.fit(Pmsm(4), frame, rs=gb.free(1.0, within=(0.01, 10)), ls=gb.free(2e-3), ke=gb.free(0.7))
"""

from __future__ import annotations

from numpy import (
    arccos,
    arcsin,
    arctan,
    arctan2,
    clip,
    cos,
    cosh,
    exp,
    hypot,
    log,
    log10,
    maximum,
    minimum,
    sign,
    sin,
    sinh,
    sqrt,
    tan,
    tanh,
)

from greybox import dask, pmsm, ray, spark
from greybox._core import Parameter, __version__
from greybox.align import align
from greybox.bootstrap import Bootstrap
from greybox.errors import Error, FitWarning, ModelWarning, RecordWarning, TraceError
from greybox.files import read
from greybox.fitting import fit, simulate
from greybox.fleets import fleet
from greybox.model import Equations, Model, model
from greybox.numpy_functions import interp, interp2
from greybox.parameters import fixed, free
from greybox.process_noise import ProcessNoise
from greybox.profile import Profile
from greybox.records import Record
from greybox.report import Report
from greybox.result import Fit
from greybox.signals import Signals, Values, Vector, signals
from greybox.symbols import Condition, Symbol, where
from greybox.text import TextModel, load

__all__ = [
    "Bootstrap",
    "Condition",
    "Equations",
    "Error",
    "Fit",
    "FitWarning",
    "Model",
    "ModelWarning",
    "Parameter",
    "ProcessNoise",
    "Profile",
    "Record",
    "RecordWarning",
    "Report",
    "Signals",
    "Symbol",
    "TextModel",
    "TraceError",
    "Values",
    "Vector",
    "__version__",
    "align",
    "arccos",
    "arcsin",
    "arctan",
    "arctan2",
    "clip",
    "cos",
    "cosh",
    "dask",
    "exp",
    "fit",
    "fleet",
    "fixed",
    "free",
    "hypot",
    "interp",
    "interp2",
    "load",
    "log",
    "log10",
    "maximum",
    "minimum",
    "model",
    "pmsm",
    "ray",
    "read",
    "sign",
    "signals",
    "simulate",
    "sin",
    "sinh",
    "spark",
    "sqrt",
    "tan",
    "tanh",
    "where",
]
