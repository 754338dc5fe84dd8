"""Figures by matplotlib."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from greybox.errors import Error
from greybox.model import Equations
from greybox.signals import named

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def _figure(rows: int, columns: int = 1, *, share: bool = True) -> tuple[Figure, Any]:
    try:
        import matplotlib.pyplot as plt
    except ImportError:
        raise Error("plots are made by matplotlib, which is not installed: pip install matplotlib; or use fit.report(path)") from None
    figure, axes = plt.subplots(
        rows, columns, sharex=share, squeeze=False, figsize=(8, 1.2 + 1.8 * rows), layout="constrained"
    )
    return figure, axes


def _parts(columns: dict[str, Any]) -> list[tuple[str, dict[str, Any]]]:
    """Give the records one by one."""
    if "record" not in columns:
        return [("", columns)]
    names = list(dict.fromkeys(columns["record"]))
    of = np.asarray(columns["record"])
    return [(str(name), {key: np.asarray(column)[of == name] for key, column in columns.items()}) for name in names]


def response(columns: dict[str, Any], equations: Equations) -> Figure:
    """Plot measured and predicted outputs, and the inputs."""
    outputs, inputs = named(equations.outputs, "outputs"), named(equations.inputs, "inputs")
    figure, axes = _figure(len(outputs) + len(inputs))
    for record, of in _parts(columns):
        label = f" {record}".rstrip()
        for axis, (name, unit) in zip(axes[:, 0], [*outputs.items(), *inputs.items()], strict=True):
            if axis in axes[: len(outputs), 0]:
                axis.plot(of["t"], of[name], ".", ms=2, alpha=0.5, label="measured" + label)
                axis.plot(of["t"], of[f"{name}_predicted"], lw=1, label="predicted" + label)
            else:
                axis.plot(of["t"], of[name], lw=1, drawstyle="steps-post", label=record or None)
            axis.set_ylabel(f"{name} ({unit or '1'})")
    axes[0, 0].legend()
    axes[-1, 0].set_xlabel("t (s)")
    return figure


def residuals(columns: dict[str, Any], equations: Equations) -> Figure:
    """Plot residuals over time, their autocorrelation and their distribution."""
    outputs = named(equations.outputs, "outputs")
    figure, axes = _figure(len(outputs), 3, share=False)
    for (over, correlated, distribution), (name, unit) in zip(axes, outputs.items(), strict=True):
        for _, of in _parts(columns):
            errors = np.asarray(of[f"{name}_residual"], dtype=float)
            over.plot(of["t"], errors, ".", ms=2)
            errors = errors[np.isfinite(errors)]
            if len(errors) > 2 and errors.std() > 0:
                correlated.stem(*_autocorrelation(errors), markerfmt=".", basefmt=" ")
                correlated.axhspan(*(np.array([-2.58, 2.58]) / np.sqrt(len(errors))), alpha=0.2)
            distribution.hist(errors, bins=30, alpha=0.6)
        over.set(xlabel="t (s)", ylabel=f"residual of {name} ({unit or '1'})")
        correlated.set(xlabel="lag (samples)", ylabel="autocorrelation")
        distribution.set(xlabel=f"residual ({unit or '1'})", ylabel="samples")
    return figure


def _autocorrelation(errors: Any) -> tuple[Any, Any]:
    centered = errors - errors.mean()
    lags = np.arange(1, min(25, len(errors) // 4) + 1)
    return lags, np.array([centered[k:] @ centered[:-k] for k in lags]) / (centered @ centered)


def profile(name: str, values: Any, rises: Any, threshold: float) -> Figure:
    """Plot a profile."""
    figure, axes = _figure(1)
    axes[0, 0].plot(values, rises, ".-")
    axes[0, 0].axhline(threshold, ls="--", lw=1)
    axes[0, 0].set(xlabel=name, ylabel="rise of the deviance", ylim=(0, 2 * threshold))
    return figure
