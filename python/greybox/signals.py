"""Named quantities: of a model (`Signals`), of a sample (`Vector`), of a result (`Values`)."""

from __future__ import annotations

import difflib
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, TypeAlias

import numpy as np

from greybox.errors import Error
from greybox.symbols import Symbols, refuse

__all__ = ["Signals", "Values", "Vector", "distinct", "named", "near", "signals"]

#: How quantities may be given: by :func:`signals`, as a mapping from names to units, or as names without units.
SignalsLike: TypeAlias = "Signals | Mapping[str, str] | Iterable[str]"


def near(name: str, names: Iterable[str]) -> str:
    """Name what is there, the nearest names first where there are many."""
    name, names = str(name), [str(one) for one in names]
    close = difflib.get_close_matches(name, names, n=5, cutoff=0.5)
    lower = difflib.get_close_matches(name.lower(), [one.lower() for one in names], n=5, cutoff=0.5)
    close += [one for one in names if one.lower() in lower and one not in close]
    shown = names if len(names) <= 10 else (close or names[:10])
    said = ", ".join(shown) if shown else "none"
    meant = f"; did you mean `{close[0]}`?" if close else ""
    return said + (", ..." if len(shown) < len(names) else "") + meant


def distinct(names: Iterable[str]) -> list[str]:
    """Number names that occur several times, as the library does: ``run.csv #1``, ``run.csv #2``."""
    names, seen = list(names), Counter[str]()
    counts, found = Counter(names), []
    for name in names:
        seen[name] += 1
        found.append(name if counts[name] == 1 else f"{name} #{seen[name]}")
    return found


class Signals(Mapping[str, str]):
    """Names and units of the quantities of a vector, in order; made by :func:`signals`."""

    __slots__ = ("_units",)

    def __init__(self, units: Mapping[str, str]) -> None:
        self._units = dict(units)
        for name, unit in self._units.items():
            if not isinstance(unit, str):
                raise Error(f"the unit of `{name}` is {unit!r}; write it as text, such as {name}=\"rad/s\"")

    def __getitem__(self, name: str) -> str:
        return self._units[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._units)

    def __len__(self) -> int:
        return len(self._units)

    def __repr__(self) -> str:
        return f"signals({', '.join(f'{name}={unit!r}' for name, unit in self.items())})"


def signals(**units: str) -> Signals:
    """Declare the quantities of a vector, in order: names and units.

    Parameters
    ----------
    **units : str
        The unit of each; ``"1"`` or ``""`` for a ratio. Of names that Python has no identifiers for, a mapping does as well:
        ``gb.Signals({"i.d": "A"})``.

    Examples
    --------
    >>> import greybox as gb
    >>> gb.signals(id="A", iq="A")
    signals(id='A', iq='A')
    """
    return Signals(units)


def named(of: SignalsLike, what: str) -> Signals:
    """Give quantities as :class:`Signals`."""
    if isinstance(of, Signals):
        return of
    if isinstance(of, Mapping):
        return Signals(of)
    if isinstance(of, str):
        raise Error(f"the {what} are the text {of!r}; write {what} = gb.signals({of}=\"unit\")")
    names = list(of) if isinstance(of, Iterable) else [of]
    if not all(isinstance(name, str) for name in names):
        raise Error(f"the {what} are {names!r}; write {what} = gb.signals(name=\"unit\", ...)")
    if len(set(names)) < len(names):
        raise Error(f"the {what} {', '.join(names)} have a name that occurs twice; rename one")
    return Signals(dict.fromkeys(names, ""))


class Values(Mapping[str, Any]):
    """Values by name: as attributes (``v.rs``), as entries (``v["rs"]``), in order as an array."""

    __slots__ = ("_names", "_values", "_what")

    def __init__(self, what: str, names: Iterable[str], values: Iterable[Any]) -> None:
        self._what = what
        self._names = tuple(names)
        self._values = tuple(values)

    def __getitem__(self, name: str) -> Any:
        try:
            return self._values[self._names.index(name)]
        except ValueError:
            raise KeyError(self._missing(name)) from None

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        try:
            return self._values[self._names.index(name)]
        except ValueError:
            raise AttributeError(self._missing(name)) from None

    def _missing(self, name: str) -> str:
        return f"there is no `{name}` among the {self._what}: {near(name, self._names)}"

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *self._names]

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> np.ndarray[Any, np.dtype[Any]]:
        return np.array(self._values, dtype=dtype)

    def __getstate__(self) -> tuple[Any, ...]:
        return (self._what, self._names, self._values)

    def __setstate__(self, state: tuple[Any, ...]) -> None:
        self._what, self._names, self._values = state

    def __repr__(self) -> str:
        return f"{self._what}({', '.join(f'{name}={value!r}' for name, value in self.items())})"


class Vector:
    """A vector of symbols with named entries: states, inputs or parameters, as a model's functions get them.

    An entry is read by name (``x.id``, ``x["id"]``) or by place (``x[0]``), and all of them by iteration. As an array it is one of
    symbols: ``A @ x``.
    """

    __slots__ = ("_entries", "_names", "_what")

    def __init__(self, what: str, names: Iterable[str], entries: Iterable[Any]) -> None:
        self._what = what
        self._names = tuple(names)
        self._entries = tuple(entries)

    def like(self, **entries: Any) -> Vector:
        """Give a vector of the same quantities with other entries.

        Parameters
        ----------
        **entries : symbol or number
            One for each quantity.

        Raises
        ------
        TraceError
            If an entry is missing, or has a name that is not among the quantities.
        """
        return Vector(self._what, self._names, in_order(entries, self._names, f"like() of the {self._what}"))

    def __getattr__(self, name: str) -> Any:
        # NumPy looks for its own attributes, and goes on without.
        if name.startswith("__") or (name not in self._names and hasattr(np.ndarray, name)):
            raise AttributeError(f"a vector has no attribute `{name}`; np.asarray(x) is an array of its entries")
        return self[name]

    def __getitem__(self, key: Any) -> Any:
        if isinstance(key, str):
            if key not in self._names:
                refuse(f"there is no `{key}` among the {self._what}: {near(key, self._names)}")
            return self._entries[self._names.index(key)]
        return _array(self._entries[key]).view(Symbols) if isinstance(key, slice) else self._entries[key]

    def __len__(self) -> int:
        return len(self._entries)

    def __iter__(self) -> Iterator[Any]:
        return iter(self._entries)

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> np.ndarray[Any, np.dtype[Any]]:
        return _array(self._entries)

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **kwargs: Any) -> Any:
        return getattr(ufunc, method)(*_opened(inputs), **kwargs)

    def __array_function__(self, function: Any, types: Any, args: Any, kwargs: Any) -> Any:
        return function(*_opened(args), **_opened(kwargs))

    def keys(self) -> tuple[str, ...]:
        """Give the names, in order."""
        return self._names

    def __repr__(self) -> str:
        return f"<{self._what} {', '.join(self._names)}>"


def _array(entries: Sequence[Any]) -> np.ndarray[Any, np.dtype[Any]]:
    array = np.empty(len(entries), dtype=object)
    array[:] = entries
    return array


def _opened(value: Any) -> Any:
    """Give arguments of NumPy with an array of symbols in the place of each vector."""
    if isinstance(value, Vector):
        return value[:]
    if isinstance(value, dict):
        return {name: _opened(one) for name, one in value.items()}
    return type(value)(_opened(one) for one in value) if isinstance(value, (list, tuple)) else value


def in_order(entries: Mapping[str, Any], names: tuple[str, ...], where: str) -> list[Any]:
    """Give the entries of a mapping in the order of names."""
    missing = [name for name in names if name not in entries]
    unknown = [name for name in entries if name not in names]
    if missing or unknown:
        lacks = f"lacks {', '.join(f'`{name}`' for name in missing)}" if missing else ""
        has = f"has {', '.join(f'`{name}`' for name in unknown)}, which is not among them" if unknown else ""
        refuse(f"{where} {' and '.join(filter(None, [lacks, has]))}; give each of {', '.join(names)} once")
    return [entries[name] for name in names]
