"""Signals that were sampled at their own instants, brought to one column of times."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal, TypeAlias

import numpy as np

from greybox.checks import mapping, number, shown
from greybox.errors import Error, RecordWarning, warn
from greybox.frames import Array
from greybox.signals import near

__all__ = ["Method", "align"]

#: How a signal gets its values at common instants.
Method: TypeAlias = Literal["last", "linear", "mean", "own"]

_METHODS = ("last", "linear", "mean", "own")
#: Instants this part of a sample apart are one.
_SAME = 1e-6


def align(
    signals: Mapping[str, tuple[Any, Any]],
    /,
    *,
    method: Method | Mapping[str, Method] | None = None,
    step: float | None = None,
) -> dict[str, Array]:
    """Bring signals that have instants of their own to one column of times.

    The common times go from the latest first sample to the earliest last one, of those signals that are filled in between samples.

    Parameters
    ----------
    signals : mapping from str to (times, values)
        Times (s), increasing, and the values there.
    method : {"last", "linear", "mean", "own"}, or mapping from signal to these
        ``"last"`` (the default) takes the value of the sample before, as a command that is held; ``"linear"`` a straight line between
        samples; ``"mean"`` the mean of the samples that are nearest to an instant, for signals that are sampled faster; ``"own"`` has each
        sample once, at the nearest instant, and NaN between them, for outputs that are sampled slower.
    step : float, optional
        The time between common instants (s); without it, they are those of the signal with the most samples.

    Returns
    -------
    dict from str to array
        ``t``, and each signal: a frame for :func:`greybox.fit`.

    Raises
    ------
    Error
        If a signal is empty or its times do not increase, or the signals have no time in common.

    Warns
    -----
    RecordWarning
        Where the method matters: of a signal that is sampled slower and filled in, of one that is sampled faster and thinned out, and of
        samples that ``"own"`` moves by more than a tenth of what is between common instants.

    Examples
    --------
    >>> import greybox as gb
    >>> t = [0.0, 1.0, 2.0, 3.0, 4.0]
    >>> gb.align({"u": (t, [0, 1, 2, 3, 4]), "y": ([0.0, 2.0, 4.0], [5, 6, 7])}, method={"y": "own"})["y"].tolist()
    [5.0, nan, 6.0, nan, 7.0]
    """
    if not mapping("the first argument", signals, "the times and the values of each signal by its name: {\"u\": (times, values)}"):
        raise Error("there are no signals to align")
    of = {name: _checked(name, *_pair(name, pair)) for name, pair in signals.items()}
    chosen = _methods(method, list(of))
    filled = {name: pair for name, pair in of.items() if chosen[name] != "own"} or of
    first, last = max(times[0] for times, _ in filled.values()), min(times[-1] for times, _ in filled.values())
    if first > last:
        late = next(name for name, (times, _) in filled.items() if times[0] == first)
        early = next(name for name, (times, _) in filled.items() if times[-1] == last)
        raise Error(f"the signals have no time in common: `{early}` ends at {last:g} s, and `{late}` begins at {first:g} s")
    common = _common(of, first, last, step)
    between = _spacing(common)
    found: dict[str, Array] = {"t": common}
    for name, (times, values) in of.items():
        _remark(name, chosen[name], times, common)
        found[name] = _brought(chosen[name], times, values, common, between)
    return found


def _pair(name: str, given: Any) -> tuple[Any, Any]:
    if not isinstance(given, (tuple, list)) or len(given) != 2:
        raise Error(f"signal `{name}` is {shown(given)}; give its times and its values: (times, values)")
    return given[0], given[1]


def _checked(name: str, times: Any, values: Any) -> tuple[Array, Array]:
    if np.asarray(times).dtype.kind in "mM":
        raise Error(f"signal `{name}` has dates as times; give seconds from one instant that all signals have in common")
    times, values = (np.ma.filled(one.astype(np.float64), np.nan) if isinstance(one, np.ma.MaskedArray) else one for one in (times, values))
    times, values = np.asarray(times, dtype=np.float64), np.asarray(values)
    if values.dtype.kind not in "fiub":
        raise Error(f"signal `{name}` has {values.dtype} in place of numbers; leave it out")
    if times.ndim != 1 or times.shape != values.shape:
        raise Error(f"signal `{name}` has {times.shape} times and values of the shape {values.shape}; every value needs a time")
    if len(times) == 0:
        raise Error(f"signal `{name}` has no samples; leave it out")
    if not np.isfinite(times).all():
        raise Error(f"signal `{name}` has a time that is no number at sample {int(np.argmin(np.isfinite(times)))}")
    back = np.flatnonzero(np.diff(times) <= 0.0)
    if len(back):
        k = int(back[0])
        raise Error(f"signal `{name}`: the time does not increase at sample {k + 1}: {times[k]:g} s, then {times[k + 1]:g} s")
    return times, values.astype(np.float64)


def _methods(method: Method | Mapping[str, Method] | None, names: list[str]) -> dict[str, Method]:
    every: Method = method if isinstance(method, str) else "last"
    given: dict[str, Method] = dict(method) if isinstance(method, Mapping) else dict.fromkeys(names, every)
    for name, one in given.items():
        if name not in names:
            raise Error(f"method names `{name}`; the signals are: {near(name, names)}")
        if one not in _METHODS:
            raise Error(f"method of `{name}` is {one!r}; take one of {', '.join(map(repr, _METHODS))}")
    return {name: given.get(name, every) for name in names}


def _common(of: Mapping[str, tuple[Array, Array]], first: float, last: float, step: float | None) -> Array:
    if step is not None:
        step = number("step", step)
        if not (np.isfinite(step) and step > 0.0):
            raise Error(f"the step is {step!r}; it must be positive and finite (s)")
        return np.asarray(first + step * np.arange(int((last - first) / step * (1 + 1e-12)) + 1), dtype=np.float64)
    densest = max((times for times, _ in of.values()), key=lambda times: int(((times >= first) & (times <= last)).sum()))
    return densest[(densest >= first) & (densest <= last)]


def _spacing(times: Array) -> float:
    return float(np.median(np.diff(times))) if len(times) > 1 else float("inf")


def _remark(name: str, method: Method, times: Array, common: Array) -> None:
    own, between = _spacing(times), _spacing(common)
    if not (np.isfinite(own) and np.isfinite(between)):
        return
    if method != "own" and own > 1.5 * between:
        delay = "" if method == "linear" else f", late by {own / 2:.3g} s in the mean"
        text = (
            f"`{name}` is sampled each {own:.3g} s and filled in each {between:.3g} s ({method}{delay}); an output that is filled in counts "
            'each measurement several times: method={"' + name + '": "own"} has each once'
        )
    elif method != "mean" and between > 1.5 * own:
        text = (
            f"`{name}` is sampled each {own:.3g} s, and each {between:.3g} s one of its samples is taken ({method}): what is faster shows as "
            'slow; method={"' + name + '": "mean"} averages'
        )
    elif method == "own" and (moved := _moved(times, common)) > 0.1 * between:
        text = (
            f"samples of `{name}` are moved by up to {moved:.3g} s to the nearest common instant; a smaller step moves them less"
        )
    else:
        return
    warn(RecordWarning(text))


def _moved(times: Array, common: Array) -> float:
    within = times[(times >= common[0]) & (times <= common[-1])]
    after = np.searchsorted(common, within).clip(1, len(common) - 1)
    return float(np.minimum(np.abs(within - common[after - 1]), np.abs(within - common[after])).max(initial=0.0))


def _brought(method: Method, times: Array, values: Array, common: Array, between: float) -> Array:
    if method == "linear":
        return np.interp(common, times, values)
    near_ = _SAME * (between if np.isfinite(between) else 1.0)
    # The common instant that is nearest to each sample, and the samples that are nearer to one than half of what is between them.
    nearest = np.searchsorted((common[1:] + common[:-1]) / 2, times)
    distance = np.abs(times - common[nearest])
    inside = (distance <= max(near_, between / 2 + near_)) & np.isfinite(values)
    if method == "own":
        found = np.full(len(common), np.nan)
        # Of several samples at one instant, the nearest stays: it is written last.
        order = np.flatnonzero(inside)[np.argsort(-distance[inside], kind="stable")]
        found[nearest[order]] = values[order]
        return found
    # The sample at or before each common instant; rounding of the times sets none back.
    held = values[np.searchsorted(times, common + near_, side="right") - 1]
    if method == "last":
        return held
    counts = np.bincount(nearest[inside], minlength=len(common))
    sums = np.bincount(nearest[inside], weights=values[inside], minlength=len(common))
    return np.where(counts > 0, sums / np.maximum(counts, 1), held)
