"""`Report`: an estimate as something to read."""

from __future__ import annotations

import os

from greybox import _core
from greybox.checks import path as path_of

__all__ = ["Report"]


class Report:
    """A report on an estimate, by :meth:`greybox.Fit.report`. Printed, it is text of 80 columns; in a notebook, the page."""

    def __init__(self, made: _core.Report) -> None:
        self._made = made

    @property
    def reasons(self) -> list[tuple[str, str]]:
        """Why the estimate is not simply usable, the worst first: how bad each reason is, and what it is."""
        return self._made.reasons

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write it as ``.html``, ``.md``, ``.json`` or ``.txt``; whole or not at all.

        Raises
        ------
        Error
            If the path has another ending, or cannot be written to.
        """
        self._made.save(path_of("path", path))

    def to_html(self) -> str:
        """Give one self-contained page."""
        return self._made.to_html()

    def to_markdown(self) -> str:
        """Give Markdown with tables."""
        return self._made.to_markdown()

    def to_json(self) -> str:
        """Give the JSON of ``schema/report.schema.json``."""
        return self._made.to_json()

    def __str__(self) -> str:
        return str(self._made)

    __repr__ = __str__

    def _repr_html_(self) -> str:
        import html

        page = html.escape(self.to_html())
        return f'<iframe srcdoc="{page}" style="width: 100%; height: 40em; border: 0"></iframe>'
