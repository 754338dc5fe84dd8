"""Exceptions and warnings."""

from __future__ import annotations

import re
import sys
import warnings

__all__ = ["Error", "FitWarning", "ModelWarning", "RecordWarning", "TraceError", "in_python", "warn"]


class Error(ValueError):
    """A call that cannot be served; its text names the thing, the number and the remedy."""


class TraceError(Error, TypeError):
    """Python code of a model that asks of a symbol what only a number has; its text names file, line and remedy."""


class ModelWarning(UserWarning):
    """Something odd in a model file: a unit that does not fit, a quantity that is not used."""


class RecordWarning(UserWarning):
    """Something that was done to signals of a file and matters to a fit."""


class FitWarning(UserWarning):
    """Something that the reader of an estimate must know.

    The message begins with the code in brackets, so that a filter of `warnings` can name it::

        warnings.filterwarnings("ignore", r"\\[colored_errors\\]", greybox.FitWarning)

    Attributes
    ----------
    code : str
        The kind of warning; it does not change from version to version, the words of `text` may.
    severity : str
        ``"usable"`` (a note), ``"usable_with_care"`` or ``"not_usable"``.
    text : str
        The warning in words, with the numbers and the remedy.
    """

    def __init__(self, code: str, severity: str, text: str) -> None:
        super().__init__(code, severity, text)
        self.code = code
        self.severity = severity
        self.text = text

    def __str__(self) -> str:
        return f"[{self.code}] {self.text}"


def warn(warning: Warning) -> None:
    """Issue a warning at the line of the caller outside this package."""
    frame, level = sys._getframe(1), 2
    while frame.f_back is not None and str(frame.f_globals.get("__name__", "")).partition(".")[0] == "greybox":
        frame, level = frame.f_back, level + 1
    warnings.warn(warning, stacklevel=level)


def in_python(text: str) -> str:
    """Give an error of the library's reader with the remedies that there are in Python."""
    for theirs, ours in (
        (
            r'give DataFile::factor\("([^"]+)", ([^)]*)\) if it counts revolutions, or DataFile::factor\("[^"]+", ([^)]*)\) if',
            r"give a frame in which `\1` is multiplied by \2 if it counts revolutions, or by \3 if",
        ),
        (r'DataFile::factor\("([^"]+)", ([^)]*)\), or 1 if', r"a frame in which `\1` is multiplied by \2, or by 1 if"),
        (r'DataFile::unit\("([^"]+)", ("[^"]+")\), which', r"a frame in which `\1` is converted from \2, which"),
        (r', which converts it, or DataFile::factor\("[^"]+", 1\) if', r", or a frame as it stands if"),
        (r'give DataFile::factor\("[^"]+", 1\) if', r"give a frame as it stands if"),
        (r'give DataFile::factor\("([^"]+)", \.\.\)', r"give a frame in which `\1` is converted"),
    ):
        text = re.sub(theirs, ours, text)
    return text
