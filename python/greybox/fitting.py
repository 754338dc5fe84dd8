"""`fit`, and simulation."""

from __future__ import annotations

import inspect
import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from greybox import _core
from greybox.checks import flag, text, whole
from greybox.errors import Error, warn
from greybox.frames import joined
from greybox.model import Model, checked
from greybox.options import Noise, by_name, settings
from greybox.parameters import Parameter, check_labels, declared, together
from greybox.progress import Progress
from greybox.records import Hold, Initial, Record, framed, is_path, kind_of, records
from greybox.result import Fit
from greybox.signals import Signals, named

__all__ = ["fit", "simulate"]


def fit(
    model: Model,
    data: Any,
    /,
    *,
    parameters: Mapping[str, Parameter] | None = None,
    time: str | None = None,
    sample_time: float | None = None,
    columns: Mapping[str, str] | None = None,
    hold: Hold | None = None,
    initial: Initial | None = None,
    noise: Noise | None = None,
    input_noise: Mapping[str, float] | None = None,
    loss: str | None = None,
    weighting: Callable[..., Any] | None = None,
    prefilter: str | None = None,
    integrator: str | None = None,
    predictor: str | None = None,
    optimizer: str | None = None,
    starts: int | None = None,
    staged: bool | None = None,
    multiple_shooting: bool | None = None,
    time_limit: float | None = None,
    checkpoint: str | os.PathLike[str] | None = None,
    progress: bool = False,
    **declarations: Parameter,
) -> Fit:
    """Find the parameters of a model from measured records, and how well they are known.

    Parameters
    ----------
    model : Model
        The equations.
    data : frame, path, Record, or list of these
        What was measured: columns of time, inputs and outputs by their names, as :class:`Record` describes; or a file of it. Several records share
        the parameters and have an initial state each.
    **declarations : Parameter
        ``rs=gb.free(1.0, within=(0.01, 10))`` or ``rs=gb.fixed(0.6)`` for each parameter of the model.
    parameters : mapping from str to Parameter, optional
        The same as a mapping: for names that are those of an option, or no identifiers.
    time, sample_time, columns, hold, initial
        Of the frames, as in :class:`Record`, which can say them for each.
    noise : mapping from str to float, or "covariance", optional
        The standard deviation of the noise of outputs, in their units; that of others is as a model file says, or estimated.
        ``"covariance"`` estimates it with the correlations between outputs.
    input_noise : mapping from str to float, optional
        The standard deviation of the noise of inputs; others have none. It changes no estimate: the bias that it causes is estimated, and a
        warning names it.
    loss : str, optional
        What errors cost: ``"squared"`` (the default), or, against outliers, ``"huber"``, ``"soft-l1"``, ``"cauchy"``, ``"tukey"``, with
        a tuning constant if wanted: ``"huber:1.345"``.
    weighting : callable, optional
        A weight for the cost of each sample, ``lambda t, u, y: abs(u.w)``: it is read with symbols of time, inputs and measured
        outputs. It is not an inverse variance.
    prefilter : str, optional
        A Butterworth filter of errors and slopes, with order and cut-off (Hz): ``"low-pass:4,100"`` or ``"high-pass:2,0.5"``.
    integrator : str, optional
        ``"rk4:4"`` (steps per sample), ``"rk45:1e-8"`` (adaptive, relative tolerance), ``"esdirk"`` (stiff). Without it, the step is
        refined until it no longer matters.
    predictor : str, optional
        Which prediction error is minimized: of a ``"simulation"`` (the default), ``"horizon:5"`` (five samples ahead of a measured
        state), ``"kalman"`` (one-step errors of a filter, for disturbed plants; the model has `diffusion` and `noise`), or
        ``"second-order"`` (a filter for strong noise). After a colon stands the covariance at the first sample, if it is not what
        `initial_noise` of the model says: ``"kalman:stationary"``, ``"kalman:first-interval"``.
    optimizer : str, optional
        ``"levenberg-marquardt"`` or ``"gauss-newton"``.
    starts : int, optional
        Search from so many starts within the bounds.
    staged : bool, optional
        Improve each start in stages before the search, by fits of predictions of a filter that corrects the state at each sample, in each further
        stage less: for starts from which a simulation diverges, and for chaotic or unstable plants. A fit does so by itself where its start cannot
        be simulated, and where its search leaves an output unexplained.
    multiple_shooting : bool, optional
        Improve each start by multiple shooting alone: the records in pieces with initial states of their own, whose gaps are closed step by step. A fit
        with `staged` does so after its stages where a simulation does not follow the measurements yet; ask for one of the two.
    time_limit : float, optional
        Stop at the best point so far after this time (s).
    checkpoint : path, optional
        Save the search to this file and resume from it.
    progress : bool
        Show iterations and cost while it runs (needs tqdm).

    Returns
    -------
    Fit
        Ctrl-C stops the search and returns the best so far, which its verdict says.

    Raises
    ------
    Error
        If there is no result: the text names the thing, the number and the remedy.

    Warns
    -----
    FitWarning
        Everything that the reader of the estimate must know; each has a code.

    Examples
    --------
    >>> import greybox as gb
    >>> import numpy as np
    >>> cooling = gb.model(
    ...     lambda t, x, u, p: [p.k * (20 - x.body)], states={"body": "K"}, outputs={"body": "K"}, parameters={"k": "1/s"}
    ... )
    >>> t = np.arange(200) * 0.1
    >>> noise = np.random.default_rng(1).normal(0.0, 0.05, 200)
    >>> found = gb.fit(cooling, {"t": t, "body": 20 + 60 * np.exp(-0.3 * t) + noise}, k=gb.free(1.0))
    >>> round(found.parameters.k, 3), found.verdict
    (0.3, 'usable')
    """
    equations = checked(model).equations()
    given = {**equations.declared, **together(parameters, declarations, inspect.signature(fit).parameters)}
    chosen = settings(
        equations,
        {
            "noise": noise,
            "input_noise": input_noise,
            "loss": loss,
            "weighting": weighting,
            "prefilter": prefilter,
            "integrator": integrator,
            "predictor": predictor,
            "optimizer": optimizer,
            "starts": starts,
            "staged": staged,
            "multiple_shooting": multiple_shooting,
            "time_limit": time_limit,
            "checkpoint": checkpoint,
        },
    )
    what = Record(None, None, time, sample_time, columns, hold, initial)
    several = records(data, what)
    cores = [one.core(equations, f"record {k + 1}" if len(several) > 1 else "record") for k, one in enumerate(several)]
    declared_ = declared(given, named(equations.parameters, "parameters"))
    check_labels(equations, declared_, [core.name for core in cores])
    problem = _core.Problem(equations.core, cores, declared_, chosen)
    with Progress(progress, "fit") as bar:
        estimate = problem.run(bar)
    files = [Path(one.data).resolve() for one in several if is_path(one.data)]
    found = Fit(equations, cores, declared_, chosen, kind_of(several[0].data), estimate, problem, what, files)
    for warning in found.warnings:
        if warning.severity != "usable":
            warn(warning)
    return found


def simulate(
    model: Model,
    data: Any,
    /,
    *,
    parameters: Mapping[str, float],
    initial: Mapping[str, float] | None = None,
    noise: Mapping[str, float] | None = None,
    noisy: bool = False,
    seed: int = 1,
    time: str | None = None,
    sample_time: float | None = None,
    columns: Mapping[str, str] | None = None,
    hold: Hold | None = None,
    integrator: str | None = None,
) -> Any:
    """Simulate a model, without noise unless `noisy` or `noise` asks for it.

    Parameters
    ----------
    model : Model
        The equations.
    data : frame
        Columns of time and inputs, as in :class:`Record`.
    parameters : mapping from str to float
        The value of each parameter.
    initial : mapping from str to float, optional
        The state at the first sample. One that is left out is as the model says it (``initial``), or zero.
    noise : mapping from str to float, optional
        The standard deviation of white noise that is added to each output; without it, and of outputs that are left out, there is none but that
        of `noisy`.
    noisy : bool
        Simulate with the noise that the model has: process noise disturbs the states (``diffusion``), and white noise is added to the outputs (``noise``) that
        are not in `noise`. Process noise is drawn at each sample, with the slopes of the model at the sample before: exact of models that are linear in
        their states, of others to the first order in the time between samples.
    seed : int
        The same seed gives the same noise; without noise it has no effect.
    time, sample_time, columns, hold
        Of the frame, as in :class:`Record`.
    integrator : str, optional
        As in :func:`fit`; else what a model file says, else steps of Runge-Kutta 4 that become finer until the outputs change by less than a part of
        1e-6, or implicit ones.

    Returns
    -------
    frame
        Of the kind that was handed over: ``t``, the inputs and the outputs.

    Raises
    ------
    Error
        If the simulation fails, or something that is given does not fit the model.
    """
    equations = checked(model).equations()
    inputs, outputs = named(equations.inputs, "inputs"), named(equations.outputs, "outputs")
    states, names = named(equations.states, "states"), named(equations.parameters, "parameters")
    values = by_name("parameters", parameters, names, "a value")
    missing = [name for name in names if name not in values]
    if missing:
        raise Error(f"parameter `{missing[0]}` has no value; give one for each of {', '.join(names)}")
    start, sigma, seed = by_name("initial", initial, states, "a value"), _sigma(noise, outputs), whole("seed", seed, 0, 2**64 - 1)
    data = framed(data)
    record = Record(data, None, time, sample_time, columns, hold).core(equations, "simulation", outputs=False)
    method = text("integrator", integrator) or equations.defaults().get("integrator")
    levels = [sigma.get(name) for name in outputs]
    noisy_seed = seed if flag("noisy", noisy) else None
    found = equations.core.simulate(list(values.values()), [start.get(name) for name in states], record, method, levels, noisy_seed)
    if sigma and noisy_seed is None:
        found = found.with_noise([level or 0.0 for level in levels], seed)
    columns_ = [*zip(inputs, found.inputs(), strict=True), *zip(outputs, found.outputs(), strict=True)]
    return kind_of(data)(joined([("t", found.time()), *columns_]))


def _sigma(noise: Mapping[str, float] | None, outputs: Signals) -> dict[str, float]:
    """Give the levels of noise by output."""
    given = by_name("noise", noise, outputs, "a standard deviation")
    for name, level in given.items():
        if not 0.0 <= level < float("inf"):
            raise Error(f"`{name}` of noise is {level!r}; give a finite standard deviation of zero or more")
    return given
