"""Arguments: what is taken for a number, a name, a flag or a path."""

from __future__ import annotations

import operator
import os
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from greybox.errors import Error

__all__ = ["column_name", "flag", "mapping", "names", "number", "path", "shown", "text", "whole"]


def shown(value: Any) -> str:
    """Give a value as it is shown in a sentence: on one line, and cut where it is long."""
    try:
        line = " ".join(repr(value).split())
    except ValueError:
        # A number of thousands of digits.
        line = type(value).__name__
    return line if len(line) <= 60 else line[:57] + "..."


def number(what: str, value: Any) -> float:
    """Give a floating-point number, also of one of NumPy; text is none.

    Raises
    ------
    Error
        If it is none.
    """
    try:
        if isinstance(value, (str, bytes, bool, np.bool_)):
            raise TypeError
        return float(value)
    except (TypeError, ValueError, OverflowError):
        raise Error(f"{what} is {shown(value)}; give a number") from None


def whole(what: str, value: Any, least: int, most: int = 10**9) -> int:
    """Give a whole number, also one of NumPy.

    Raises
    ------
    Error
        If it is none, less than `least`, or more than `most`.
    """
    try:
        given = operator.index(value)
    except TypeError:
        given = least - 1
    if given < least:
        raise Error(f"{what} is {shown(value)}; take a whole number of {least} or more")
    if given > most:
        raise Error(f"{what} is {shown(value)}; take a whole number of {most} or less")
    return given


def flag(what: str, value: Any) -> bool:
    """Give what is true or false; nothing is false.

    Raises
    ------
    Error
        If it is neither.
    """
    if value is not None and not isinstance(value, (bool, np.bool_)):
        raise Error(f"{what} is {shown(value)}; take True or False")
    return bool(value)


def text(what: str, value: Any) -> str | None:
    """Give a name, or nothing.

    Raises
    ------
    Error
        If it is no text.
    """
    if value is not None and not isinstance(value, str):
        raise Error(f"{what} is {shown(value)}; give its name as text")
    return value


def column_name(what: str, value: Any) -> str:
    """Give the name of a column, which frames may have as a whole number, too.

    Raises
    ------
    Error
        If it is none.
    """
    if not isinstance(value, (str, int, np.integer)) or isinstance(value, bool):
        raise Error(f"{what} is {shown(value)}; give the name of a column")
    return str(value)


def names(what: str, value: Any) -> list[str]:
    """Give names as a list; one text is none.

    Raises
    ------
    Error
        If what is given is no collection of names.
    """
    given = None if isinstance(value, (str, bytes)) or not isinstance(value, Iterable) else list(value)
    if given is None or not all(isinstance(name, str) for name in given):
        raise Error(f"{what} is {shown(value)}; give names in a list")
    return given


def path(what: str, value: Any) -> str:
    """Give a path as text.

    Raises
    ------
    Error
        If it is none.
    """
    if not isinstance(value, (str, os.PathLike)):
        raise Error(f"{what} is {shown(value)}; give the path of a file")
    return os.fspath(value)


def mapping(what: str, value: Any, wanted: str) -> Mapping[Any, Any]:
    """Give a mapping; nothing is an empty one.

    Raises
    ------
    Error
        If it is none, with what is `wanted`.
    """
    if value is None:
        return {}
    if not isinstance(value, Mapping):
        raise Error(f"{what} is {shown(value)}; give {wanted}")
    return value
