"""What a notebook shows of a fit."""

from __future__ import annotations

import html
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from greybox.result import Fit

__all__ = ["shown"]

_HEADS = ("parameter", "value", "unit", "std. error", "95 % interval", "index")


def shown(fit: Fit, picture: str) -> str:
    """Give the verdict, the table, the warnings and a picture (SVG) as HTML."""
    rows = ""
    for name, unit, value, knowledge, error, interval, index in fit._estimate.parameters:
        cells = [name, f"{value:.6g}", unit, "" if error is None else f"{error:.2g}"]
        cells.append(knowledge if interval is None else f"{interval[0]:.6g} … {interval[1]:.6g}")
        cells.append("" if index is None else f"{index:.3g} %")
        rows += "<tr>" + "".join(f"<td>{html.escape(cell)}</td>" for cell in cells) + "</tr>"
    head = "".join(f"<th>{one}</th>" for one in _HEADS)
    said = "".join(f"<li>{html.escape(str(one))}</li>" for one in fit.warnings)
    return (
        f"<p><b>Verdict: {fit.verdict}.</b> Search: {html.escape(fit.outcome)}.</p>"
        f"<table><thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table>"
        f"<ul>{said}</ul>{picture}"
    )
