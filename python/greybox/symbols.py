"""Symbols: the numbers that a model's Python code is read with.

A model's functions are called once. Each operation on a :class:`Symbol` adds a node to a graph of the compiled library, and no
Python code runs during a fit. NumPy's functions work on symbols and on arrays of them; what asks a symbol for a value (``if``,
``float``, ``math.sin``) raises a :class:`~greybox.TraceError` that names the line and the remedy.
"""

from __future__ import annotations

import linecache
import sys
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import Any, NoReturn, TypeAlias, Union

import numpy as np

from greybox import _core
from greybox.errors import TraceError

__all__ = ["Condition", "Number", "Symbol", "Symbols", "Trace", "called", "each", "refuse", "where"]

#: What arithmetic takes.
Number: TypeAlias = Union["Symbol", float, "np.floating[Any]", "np.integer[Any]"]

_NUMBERS = (bool, int, float, np.floating, np.integer, np.bool_)
#: Folders whose lines are not the user's.
_OWN = (str(Path(__file__).parent), str(Path(np.__file__).parent))


def refuse(what: str) -> NoReturn:
    """Raise an error that names the line of the user's code."""
    frame = sys._getframe(1)
    while frame.f_back is not None and frame.f_code.co_filename.startswith(_OWN):
        frame = frame.f_back
    raise _error(frame.f_code.co_filename, frame.f_lineno, what)


def _error(name: str, line: int, what: str) -> TraceError:
    text = linecache.getline(name, line).strip()
    text = text if len(text) <= 100 else text[:97] + "..."
    return TraceError(f"{name}, line {line}{f', in `{text}`' if text else ''}: {what}")


def called(function: Callable[..., Any], *args: Any) -> Any:
    """Call a function of the user; what NumPy says of an array of symbols is said with line and remedy."""
    try:
        return function(*args)
    except TypeError as error:
        if isinstance(error, TraceError) or not ("ufunc" in str(error) or "dtype('O')" in str(error)):
            raise
        lines = [one for one in traceback.extract_tb(error.__traceback__) if not one.filename.startswith(_OWN)]
        raise _error(lines[-1].filename, lines[-1].lineno or 0, f"{_NO_ARRAY} ({error})") from error


class Trace:
    """The graph of one reading of a model; symbols of another reading are refused."""

    __slots__ = ("graph", "open")

    def __init__(self) -> None:
        self.graph = _core.Graph()
        self.open = True

    def node(self, value: Any) -> _core.Node:
        """Give the node of a number, or of a symbol of this reading."""
        if isinstance(value, np.ndarray) and value.ndim == 0:
            value = value.item()
        if isinstance(value, Symbol):
            if value.trace is not self:
                refuse(_KEPT)
            return value.node
        if isinstance(value, _NUMBERS):
            return self.graph.constant(float(value))
        if isinstance(value, Condition):
            refuse(_NO_NUMBER)
        text = repr(value)
        refuse(f"a symbol cannot be combined with {text if len(text) <= 40 else text[:37] + '...'} ({type(value).__name__})")

    def symbol(self, value: Any) -> Symbol:
        """Give a number as a symbol."""
        return Symbol(self, self.node(value))


_KEPT = (
    "this symbol was kept from another reading of a model. The equations are read anew for each fit: use t, x, u and p as they are "
    "handed to the function, and keep none of them in a global or an attribute"
)
_NO_NUMBER = "a comparison of symbols is used as a number; write gb.where(condition, 1.0, 0.0)"
_NO_ANSWER = (
    "`if`, `and`, `or`, `not`, `while`, `a < b < c`, min and max ask for an answer, which only numbers have: the equations are read "
    "once, before there are numbers. Write gb.where(condition, a, b), where conditions combine by &, | and ~, np.minimum or np.maximum; of "
    "arrays these and comparisons work on np.stack([a, b]), not on np.array([a, b])"
)
_NO_ARRAY = (
    "NumPy has no such function of an array of symbols. Those of single entries work on np.stack([a, b]), not on np.array([a, b]); in the "
    "place of np.linalg write A @ x, np.linalg.inv(A) @ x with an A of numbers, or the solution of a system in full"
)
_NO_COMPARISON = "`&`, `|`, `^` and `~` combine comparisons, each in parentheses: (x > 0) & (x < 1)"
_NO_KEY = (
    "a symbol is looked up in a dict or a set, which find values: the equations are read once, before there are numbers. Write "
    "gb.where(x == 1, a, b), or np.interp for a table"
)
_NO_VALUE = (
    "float(), int(), round(), range(), the functions of `math` and writing into an array of floats ask a symbol for its value: the "
    "equations are read once, before there are numbers. Write np.sin for math.sin, np.floor for int, and np.stack or an array with "
    "dtype=object for numbers that are put together"
)
_NO_LENGTH = (
    "len(), iteration and `in` are for vectors, and a symbol is one number; x, u and p are vectors, with entries by name (x.id, "
    'x["id"]) and by place (x[0])'
)


def common(*values: Any) -> Trace:
    """Give the reading that the symbols among the values belong to."""
    for value in values:
        if isinstance(value, (Symbol, Condition)):
            if not value.trace.open:
                refuse(_KEPT)
            return value.trace
    raise TypeError("none of the operands is a symbol")


def plain(value: Any) -> np.ndarray[Any, np.dtype[Any]]:
    """Give what is handed to a function of NumPy as an array, a symbol as one without dimensions."""
    if isinstance(value, (Symbol, Condition)):
        single = np.empty((), dtype=object)
        single[()] = value
        return single
    return np.asarray(value)


def each(function: Callable[..., Any], *operands: Any) -> Any:
    """Apply a function to numbers, or entry by entry to arrays, which are broadcast."""
    arrays = [plain(one) for one in operands]
    if all(one.ndim == 0 for one in arrays):
        return function(*(one.item() if isinstance(one, np.ndarray) else one for one in operands))
    together = np.broadcast(*arrays)
    results = np.empty(together.shape, dtype=object)
    for place, entries in enumerate(together):
        results.flat[place] = function(*entries)
    return results.view(Symbols)


class Symbols(np.ndarray[Any, np.dtype[Any]]):
    """An array of symbols or of comparisons, whose comparisons and functions are those of its entries.

    ``np.stack([a, b])`` makes one. Of ``np.array([a, b])``, an array of any objects, NumPy asks for answers in place of comparisons.
    """

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **kwargs: Any) -> Any:
        from greybox import numpy_functions

        return numpy_functions.of_entries(ufunc, method, inputs, kwargs)

    def __array_function__(self, function: Any, types: Any, args: Any, kwargs: Any) -> Any:
        from greybox import numpy_functions

        if numpy_functions.is_special(function):
            return numpy_functions.of_arrays(function, args, kwargs)
        found = super().__array_function__(function, types, args, kwargs)
        return found.view(Symbols) if isinstance(found, np.ndarray) and found.dtype == object else found


def operation(name: str, a: Any, b: Any) -> Any:
    """Apply an operation of two numbers: ``add``, ``sub``, ``mul`` or ``div``."""

    def apply(a: Any, b: Any) -> Any:
        trace = common(a, b)
        return Symbol(trace, getattr(trace.graph, name)(trace.node(a), trace.node(b)))

    return apply(a, b) if isinstance(b, (Symbol, *_NUMBERS)) and isinstance(a, (Symbol, *_NUMBERS)) else each(apply, a, b)


def function(name: str, a: Symbol) -> Symbol:
    """Apply a function of one number."""
    trace = common(a)
    return Symbol(trace, trace.graph.function(name, a.node))


def function2(name: str, a: Any, b: Any) -> Any:
    """Apply a function of two numbers."""
    trace = common(a, b)
    return Symbol(trace, trace.graph.function2(name, trace.node(a), trace.node(b)))


def compared(comparison: str, a: Any, b: Any) -> Any:
    """Compare two numbers: ``Less``, ``LessOrEqual`` or ``Equal``."""

    def compare(a: Any, b: Any) -> Condition:
        trace = common(a, b)
        nodes = (trace.node(a), trace.node(b))

        def choose(then: Any, otherwise: Any) -> Symbol:
            return Symbol(trace, trace.graph.select(comparison, *nodes, trace.node(then), trace.node(otherwise)))

        return Condition(trace, choose)

    return each(compare, a, b)


def power(a: Any, b: Any) -> Any:
    """Give ``a ** b``; a whole ``b`` that is an int is a product."""
    if isinstance(b, (int, np.integer)) and isinstance(a, Symbol) and abs(int(b)) < 2**31:
        trace = common(a)
        return Symbol(trace, trace.graph.power(a.node, int(b)))
    return each(lambda a, b: power(a, b) if isinstance(b, (int, np.integer)) and isinstance(a, Symbol) else function2("Pow", a, b), a, b)


def floored(a: Any, b: Any) -> Any:
    """Give ``a // b``."""
    return each(lambda a, b: function("Floor", common(a, b).symbol(operation("div", a, b))), a, b)


def remainder(a: Any, b: Any) -> Any:
    """Give ``a % b``, with the sign of ``b``."""
    if isinstance(b, _NUMBERS) and b > 0:
        return each(lambda a, b: function2("RemEuclid", a, b), a, b)
    return each(lambda a, b: a - floored(a, b) * b, a, b)


class Condition:
    """A comparison of symbols, or several of them by ``&``, ``|`` and ``~``: for :func:`where`."""

    __slots__ = ("choose", "trace")
    __hash__ = None  # type: ignore[assignment]

    def __init__(self, trace: Trace, choose: Callable[[Any, Any], Symbol]) -> None:
        self.trace = trace
        self.choose = choose

    def _other(self, value: Any) -> Condition:
        if isinstance(value, Condition):
            return value
        if isinstance(value, (bool, np.bool_)):
            return Condition(self.trace, lambda a, b: self.trace.symbol(a if value else b))
        refuse(f"a comparison is combined with {value!r}, which is none; compare it with a number, in parentheses: (x > 0) & (x < 1)")

    def __and__(self, other: Any) -> Any:
        if isinstance(other, np.ndarray):
            # NumPy combines it with each entry.
            return NotImplemented
        other = self._other(other)
        return Condition(self.trace, lambda a, b: self.choose(other.choose(a, b), b))

    def __or__(self, other: Any) -> Any:
        if isinstance(other, np.ndarray):
            # NumPy combines it with each entry.
            return NotImplemented
        other = self._other(other)
        return Condition(self.trace, lambda a, b: self.choose(a, other.choose(a, b)))

    def __xor__(self, other: Any) -> Any:
        if isinstance(other, np.ndarray):
            # NumPy combines it with each entry.
            return NotImplemented
        other = self._other(other)
        return Condition(self.trace, lambda a, b: self.choose(other.choose(b, a), other.choose(a, b)))

    __rand__, __ror__, __rxor__ = __and__, __or__, __xor__

    def __eq__(self, other: object) -> Any:
        return ~(self ^ other)

    def __ne__(self, other: object) -> Any:
        return self ^ other

    def __invert__(self) -> Condition:
        return Condition(self.trace, lambda a, b: self.choose(b, a))

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **kwargs: Any) -> Any:
        from greybox import numpy_functions

        return numpy_functions.of_conditions(ufunc, method, inputs, kwargs)

    def __array_function__(self, function: Any, types: Any, args: Any, kwargs: Any) -> Any:
        from greybox import numpy_functions

        return numpy_functions.of_arrays(function, args, kwargs)

    def __bool__(self) -> NoReturn:
        refuse(_NO_ANSWER)

    def _refused(self, *_: Any) -> NoReturn:
        refuse(_NO_NUMBER)

    __add__ = __radd__ = __sub__ = __rsub__ = __mul__ = __rmul__ = __truediv__ = __rtruediv__ = _refused
    __lt__ = __le__ = __gt__ = __ge__ = __neg__ = __float__ = __int__ = _refused

    def __repr__(self) -> str:
        return "<comparison of symbols>"


class Symbol:
    """A quantity of a model while its code is read. It has operators and functions, and no value."""

    __slots__ = ("node", "trace")

    def __init__(self, trace: Trace, node: _core.Node) -> None:
        self.trace = trace
        self.node = node

    def __repr__(self) -> str:
        known = self.trace.graph.known(self.node)
        return "<symbol>" if known is None else f"<symbol of {known!r}>"

    def __neg__(self) -> Symbol:
        return Symbol(self.trace, common(self).graph.neg(self.node))

    def __pos__(self) -> Symbol:
        return self

    def __abs__(self) -> Symbol:
        return function("Abs", self)

    def __add__(self, other: Any) -> Any:
        return operation("add", self, other)

    def __radd__(self, other: Any) -> Any:
        return operation("add", other, self)

    def __sub__(self, other: Any) -> Any:
        return operation("sub", self, other)

    def __rsub__(self, other: Any) -> Any:
        return operation("sub", other, self)

    def __mul__(self, other: Any) -> Any:
        return operation("mul", self, other)

    def __rmul__(self, other: Any) -> Any:
        return operation("mul", other, self)

    def __truediv__(self, other: Any) -> Any:
        return operation("div", self, other)

    def __rtruediv__(self, other: Any) -> Any:
        return operation("div", other, self)

    def __pow__(self, other: Any) -> Any:
        return power(self, other)

    def __rpow__(self, other: Any) -> Any:
        return power(other, self)

    def __mod__(self, other: Any) -> Any:
        return remainder(self, other)

    def __rmod__(self, other: Any) -> Any:
        return remainder(other, self)

    def __floordiv__(self, other: Any) -> Any:
        return floored(self, other)

    def __rfloordiv__(self, other: Any) -> Any:
        return floored(other, self)

    def __lt__(self, other: Any) -> Any:
        return compared("Less", self, other)

    def __le__(self, other: Any) -> Any:
        return compared("LessOrEqual", self, other)

    def __gt__(self, other: Any) -> Any:
        return compared("Less", other, self)

    def __ge__(self, other: Any) -> Any:
        return compared("LessOrEqual", other, self)

    def __eq__(self, other: object) -> Any:
        return compared("Equal", self, other)

    def __ne__(self, other: object) -> Any:
        return each(lambda one: ~one, compared("Equal", self, other))

    def __bool__(self) -> NoReturn:
        refuse(_NO_ANSWER)

    def __hash__(self) -> int:
        refuse(_NO_KEY)

    def _value(self, *_: Any) -> NoReturn:
        refuse(_NO_VALUE)

    __float__ = __int__ = __index__ = __complex__ = __round__ = _value

    # NumPy calls these for the entries of an array of symbols.
    def __floor__(self) -> Symbol:
        return function("Floor", self)

    def __ceil__(self) -> Symbol:
        return function("Ceil", self)

    def __trunc__(self) -> Symbol:
        return function("Trunc", self)

    def _length(self, *_: Any) -> NoReturn:
        refuse(_NO_LENGTH)

    __len__ = __iter__ = __contains__ = _length

    def _not_compared(self, *_: Any) -> NoReturn:
        refuse(_NO_COMPARISON)

    __and__ = __rand__ = __or__ = __ror__ = __xor__ = __rxor__ = __invert__ = _not_compared

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **kwargs: Any) -> Any:
        from greybox import numpy_functions

        return numpy_functions.of_symbols(ufunc, method, inputs, kwargs)

    def __array_function__(self, function: Any, types: Any, args: Any, kwargs: Any) -> Any:
        from greybox import numpy_functions

        return numpy_functions.of_arrays(function, args, kwargs)

    def __getattr__(self, name: str) -> Any:
        # NumPy calls the functions of the entries of an array of symbols as their methods.
        if not name.startswith("_"):
            from greybox import numpy_functions

            method = numpy_functions.METHODS.get(name)
            if method is not None:
                return lambda *others: method(self, *others)
        raise AttributeError(f"a symbol has no attribute `{name}`; x, u and p have entries by name (x.id), a symbol is one number")


def where(condition: Any, then: Any, otherwise: Any) -> Any:
    """Give `then` where the condition holds, and `otherwise` where it does not: the ``if`` of equations.

    Both sides are computed for every sample and one is taken, with its slopes. A comparison with a number that is none (NaN) does
    not hold.

    Parameters
    ----------
    condition : comparison of symbols, bool, or array of these
        Comparisons combine by ``&``, ``|`` and ``~``: ``(x.w > 0) & (x.w < p.limit)``.
    then, otherwise : symbol, number, or array of these

    Examples
    --------
    >>> import greybox as gb
    >>> gb.where(2 > 1, 3.0, 4.0)
    3.0
    """

    def choose(condition: Any, then: Any, otherwise: Any) -> Any:
        if isinstance(condition, Condition):
            common(condition)
            return condition.choose(then, otherwise)
        if isinstance(condition, Symbol):
            refuse("the condition of gb.where is a symbol; compare it with a number: gb.where(x > 0, a, b)")
        return then if condition else otherwise

    return each(choose, condition, then, otherwise)
