"""NumPy's functions on symbols, and tables."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import reduce
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from greybox import _core
from greybox.checks import number
from greybox.errors import Error
from greybox.signals import Vector
from greybox.symbols import (
    Condition,
    Symbol,
    Symbols,
    common,
    compared,
    each,
    floored,
    function,
    function2,
    operation,
    plain,
    power,
    refuse,
    remainder,
    where,
)

__all__ = ["METHODS", "interp", "interp2", "is_special", "of_arrays", "of_conditions", "of_entries", "of_symbols"]

#: The library's name of each function of one number.
_NAMES = {
    "absolute": "Abs", "fabs": "Abs", "sqrt": "Sqrt", "cbrt": "Cbrt", "exp": "Exp", "exp2": "Exp2", "expm1": "ExpM1", "log": "Ln",
    "log1p": "Ln1p", "log2": "Log2", "log10": "Log10", "sin": "Sin", "cos": "Cos", "tan": "Tan", "arcsin": "Asin", "arccos": "Acos",
    "arctan": "Atan", "sinh": "Sinh", "cosh": "Cosh", "tanh": "Tanh", "arcsinh": "Asinh", "arccosh": "Acosh", "arctanh": "Atanh",
    "floor": "Floor", "ceil": "Ceil", "trunc": "Trunc", "reciprocal": "Recip",
}  # fmt: skip


def _named(name: str) -> Callable[[Symbol], Symbol]:
    return lambda a: function(name, a)


#: Functions of one number.
_UNARY: dict[str, Callable[[Any], Any]] = {
    **{ours: _named(theirs) for ours, theirs in _NAMES.items()},
    "negative": lambda a: -a,
    "positive": lambda a: a,
    "conjugate": lambda a: a,
    "square": lambda a: power(a, 2),
    "sign": lambda a: where(a > 0.0, 1.0, where(a < 0.0, -1.0, 0.0 * a)),
    "deg2rad": lambda a: a * (np.pi / 180.0),
    "radians": lambda a: a * (np.pi / 180.0),
    "rad2deg": lambda a: a * (180.0 / np.pi),
    "degrees": lambda a: a * (180.0 / np.pi),
}

#: Functions of two numbers.
_BINARY: dict[str, Callable[[Any, Any], Any]] = {
    "add": lambda a, b: operation("add", a, b),
    "subtract": lambda a, b: operation("sub", a, b),
    "multiply": lambda a, b: operation("mul", a, b),
    "divide": lambda a, b: operation("div", a, b),
    "power": power,
    "float_power": lambda a, b: function2("Pow", a, b),
    "remainder": remainder,
    "floor_divide": floored,
    "arctan2": lambda a, b: function2("Atan2", a, b),
    "hypot": lambda a, b: function2("Hypot", a, b),
    "maximum": lambda a, b: function2("Max", a, b),
    "fmax": lambda a, b: function2("Max", a, b),
    "minimum": lambda a, b: function2("Min", a, b),
    "fmin": lambda a, b: function2("Min", a, b),
    "copysign": lambda a, b: function2("Copysign", a, b),
    "heaviside": lambda a, b: where(a > 0.0, 1.0, where(a < 0.0, 0.0, b)),
    "less": lambda a, b: compared("Less", a, b),
    "less_equal": lambda a, b: compared("LessOrEqual", a, b),
    "greater": lambda a, b: compared("Less", b, a),
    "greater_equal": lambda a, b: compared("LessOrEqual", b, a),
    "equal": lambda a, b: compared("Equal", a, b),
    "not_equal": lambda a, b: ~compared("Equal", a, b),
}

#: What NumPy calls on the entries of an array of symbols.
METHODS: dict[str, Callable[..., Any]] = {**_UNARY, "arctan2": _BINARY["arctan2"], "hypot": _BINARY["hypot"]}

_LOGICAL: dict[str, Callable[..., Any]] = {
    "logical_and": lambda a, b: a & b,
    "bitwise_and": lambda a, b: a & b,
    "logical_or": lambda a, b: a | b,
    "bitwise_or": lambda a, b: a | b,
    "logical_xor": lambda a, b: a ^ b,
    "bitwise_xor": lambda a, b: a ^ b,
    "logical_not": lambda a: ~a,
    "invert": lambda a: ~a,
}

#: Ufuncs that NumPy computes by the operators of the entries, and those of two entries that reduce an array.
_OPERATORS = {"add", "subtract", "multiply", "divide", "negative", "positive", "absolute", "power", "floor_divide", "remainder", "matmul"}
_REDUCED = {"maximum", "minimum", "logical_and", "logical_or"}

#: Functions that are computed here also of arrays of symbols alone.
_SPECIAL = {"where", "clip", "interp", "select"}

#: Functions that put arrays together or add up products, which NumPy computes by the operators of the entries.
_BY_ENTRIES = {
    "stack", "concatenate", "hstack", "vstack", "column_stack", "dstack", "atleast_1d", "atleast_2d", "dot", "vdot", "inner", "outer",
    "tensordot", "kron", "cross", "sum", "prod", "cumsum", "cumprod", "mean", "diff", "full_like", "broadcast_to", "reshape", "ravel",
    "transpose", "squeeze", "expand_dims", "append", "tile", "repeat", "block", "trace", "shape", "ndim", "size",
}  # fmt: skip


def of_symbols(ufunc: np.ufunc, method: str, inputs: tuple[Any, ...], kwargs: dict[str, Any]) -> Any:
    """Apply a ufunc of which an operand is a symbol."""
    name = ufunc.__name__
    if kwargs.get("out") is not None:
        return _written(ufunc, method, inputs, kwargs)
    if method != "__call__" or kwargs:
        refuse(f"np.{name}.{method} and the options of np.{name} are not known for symbols; call np.{name}(...) alone")
    if name == "matmul":
        return of_entries(ufunc, method, inputs, kwargs)
    if name == "clip":
        return each(_clip, *inputs)
    return each(_of_entry(ufunc), *inputs)


def _of_entry(ufunc: np.ufunc) -> Callable[..., Any]:
    """Give what a ufunc is for single symbols, and for numbers that stand beside them in an array."""
    name = ufunc.__name__
    known = (_UNARY if ufunc.nin == 1 else _BINARY).get(name) or _LOGICAL.get(name)
    if known is None:
        refuse(
            f"np.{name} is not known for symbols; write it by + - * / **, gb.where and functions with slopes such as np.sqrt, np.exp, "
            "np.sin, np.tanh or np.hypot"
        )

    def of_entry(*entries: Any) -> Any:
        symbolic = any(isinstance(one, (Symbol, Condition)) for one in entries)
        return _logical(known, entries) if symbolic else ufunc(*entries)

    return of_entry


def _written(ufunc: np.ufunc, method: str, inputs: tuple[Any, ...], kwargs: dict[str, Any]) -> Any:
    """Apply a ufunc and write the result into an array of objects, as ``a += b`` does."""
    (out,) = kwargs["out"]
    if out.dtype != object:
        refuse(f"np.{ufunc.__name__} with out=, or an operator such as +=, writes symbols into an array of floats; write a = a + b")
    rest = {name: one for name, one in kwargs.items() if name != "out"}
    out[...] = getattr(ufunc, method)(*inputs, **rest)
    return out


def of_entries(ufunc: np.ufunc, method: str, inputs: tuple[Any, ...], kwargs: dict[str, Any]) -> Any:
    """Apply a ufunc of which an operand is an array of symbols."""
    name = ufunc.__name__
    if kwargs.get("out") is not None:
        return _written(ufunc, method, inputs, kwargs)
    if name in _OPERATORS:
        found = getattr(ufunc, method)(*(plain(one) for one in inputs), **kwargs)
        return found.view(Symbols) if isinstance(found, np.ndarray) else found
    if method == "reduce" and name in _REDUCED:
        return _reduced(ufunc, *inputs, **kwargs)
    return of_symbols(ufunc, method, inputs, kwargs)


def _reduced(ufunc: np.ufunc, array: Any, axis: Any = 0, dtype: Any = None, **options: Any) -> Any:
    """Reduce an array along one axis, or without one over all entries."""
    said = {name for name, value in options.items() if value is not {"keepdims": False, "where": True}.get(name)}
    if said or isinstance(axis, tuple):
        refuse(f"np.{ufunc.__name__}.reduce with options or several axes is not known for symbols; give one axis alone")
    entries = array.ravel() if axis is None else np.moveaxis(array, axis, 0)
    return reduce(lambda a, b: each(_of_entry(ufunc), a, b), entries)


def of_conditions(ufunc: np.ufunc, method: str, inputs: tuple[Any, ...], kwargs: dict[str, Any]) -> Any:
    """Apply a ufunc of which an operand is a comparison."""
    known = _LOGICAL.get(ufunc.__name__)
    if known is None or method != "__call__" or kwargs:
        refuse(f"np.{ufunc.__name__} is not known for comparisons of symbols; combine them by &, | and ~")
    return each(lambda *all_: _logical(known, all_), *inputs)


def _logical(known: Callable[..., Any], inputs: tuple[Any, ...]) -> Any:
    return known(*(bool(one) if isinstance(one, np.bool_) else one for one in inputs))


def is_special(function: Any) -> bool:
    """Whether a function of arrays is computed by :func:`of_arrays`, and not by the operators of the entries."""
    return function.__name__ in _SPECIAL


def of_arrays(function: Any, args: tuple[Any, ...], kwargs: dict[str, Any]) -> Any:
    """Apply a function of arrays of which an argument is a symbol."""
    name: str = function.__name__
    if name == "where" and len(args) == 3:
        return where(*args)
    if name == "clip":
        return each(_clip, *_three(*args, **kwargs))
    if name == "interp":
        return _interp(*args, **kwargs)
    if name == "select":
        return _select(*args, **kwargs)
    if name in _BY_ENTRIES:
        # An array of symbols that is joined is its entries; as it stands it would come back here.
        if args and (isinstance(args[0], Vector) or (isinstance(args[0], np.ndarray) and args[0].dtype == object)):
            args = ([*args[0]], *args[1:])
        result = function(*(_arrays(one) for one in args), **{key: _arrays(one) for key, one in kwargs.items()})
        if not isinstance(result, np.ndarray):
            return result
        return result.item() if result.ndim == 0 else result.view(Symbols)
    refuse(f"np.{name} is not known for symbols; write it by + - * / **, np.where and functions such as np.sqrt, np.exp or np.sin")


def _arrays(value: Any) -> Any:
    if isinstance(value, (Symbol, Condition)):
        return plain(value)
    if isinstance(value, (list, tuple)):
        return type(value)(_arrays(one) for one in value)
    return value


def _three(a: Any, a_min: Any = None, a_max: Any = None, **kwargs: Any) -> tuple[Any, Any, Any]:
    low, high = kwargs.pop("min", a_min), kwargs.pop("max", a_max)
    if kwargs:
        refuse(f"np.clip with {', '.join(kwargs)} is not known for symbols; call np.clip(x, low, high)")
    return a, low, high


def _clip(a: Any, low: Any, high: Any) -> Any:
    if low is not None and high is not None and not isinstance(low, Symbol) and not isinstance(high, Symbol) and low > high:
        ends = f"{float(low)!r} as its lower end and {float(high)!r} as its upper one"
        refuse(f"np.clip has {ends}, which is then the result everywhere; exchange them")
    above = a if low is None else where(a < low, low, a)
    return above if high is None else where(high < above, high, above)


def _select(condlist: Sequence[Any], choicelist: Sequence[Any], default: Any = 0.0) -> Any:
    for condition, choice in zip(reversed(list(condlist)), reversed(list(choicelist)), strict=True):
        default = where(condition, choice, default)
    return default


def _interp(x: Any, xp: ArrayLike, fp: ArrayLike, left: Any = None, right: Any = None, period: Any = None) -> Any:
    if not (left is None and right is None and period is None):
        refuse("np.interp with left, right or period is not known for symbols; write gb.where around gb.interp, or x % period")
    return interp(x, xp, fp)


_METHODS = {"linear": "Linear", "smooth": "Smooth"}
_OUTSIDE = {"hold": "Hold", "linear": "Linear"}


def _choice(what: str, choices: dict[str, str], value: str) -> str:
    try:
        return choices[value]
    except KeyError:
        raise Error(f"{what} is {value!r}; take one of {', '.join(map(repr, choices))}") from None


def _floats(what: str, values: ArrayLike) -> list[float]:
    array = plain(values)
    if array.dtype == object:
        refuse(f"{what} of a table is made of symbols; a table has fixed numbers")
    return [number(f"a number of {what} of a table", one) for one in array.ravel()]


def _look_up(table: _core.Table, x: Any, y: Any) -> Any:
    if not isinstance(x, Symbol) and not isinstance(y, Symbol):
        return table.at(number("what is looked up", x), number("what is looked up", y))
    trace = common(x, y)
    return Symbol(trace, trace.graph.table(table, trace.node(x), trace.node(y)))


def interp(
    x: Any,
    xp: ArrayLike,
    fp: ArrayLike,
    *,
    method: Literal["linear", "smooth"] = "linear",
    outside: Literal["hold", "linear"] = "hold",
) -> Any:
    """Look a value up in a table of one argument.

    Parameters
    ----------
    x : symbol, number, or array of these
        Where to look.
    xp : array of shape (n,)
        The points, increasing.
    fp : array of shape (n,)
        The values there.
    method : {"linear", "smooth"}
        Straight lines, or cubic polynomials with a continuous slope, which a search follows better.
    outside : {"hold", "linear"}
        Beyond the ends: the value at the end, or a straight line with the slope at the end.

    Raises
    ------
    Error
        If the points do not increase, or a number is not finite.

    Examples
    --------
    >>> import greybox as gb
    >>> gb.interp(0.5, [0.0, 1.0, 3.0], [0.0, 0.8, 1.2])
    0.4
    """
    numbers = _floats("x", xp), list[float](), _floats("the values", fp)
    table = _core.Table(*numbers, _choice("method", _METHODS, method), _choice("outside", _OUTSIDE, outside))
    return each(lambda one: _look_up(table, one, one), x)


def interp2(
    x: Any,
    y: Any,
    xp: ArrayLike,
    yp: ArrayLike,
    fp: ArrayLike,
    *,
    method: Literal["linear", "smooth"] = "linear",
    outside: Literal["hold", "linear"] = "hold",
) -> Any:
    """Look a value up in a table of two arguments.

    Parameters
    ----------
    x, y : symbol, number, or array of these
        Where to look.
    xp, yp : arrays of shape (n,) and (m,)
        The points of both axes, increasing.
    fp : array of shape (n, m)
        The values: ``fp[i, j]`` at ``xp[i]``, ``yp[j]``.
    method, outside
        As in :func:`interp`.

    Raises
    ------
    Error
        If the points do not increase, the shape of `fp` is another, or a number is not finite.
    """
    shape = (np.size(xp), np.size(yp))
    if np.shape(fp) != shape:
        raise Error(f"the values of the table have the shape {np.shape(fp)}; its axes have the lengths {shape[0]} and {shape[1]}")
    numbers = _floats("x", xp), _floats("y", yp), _floats("the values", fp)
    table = _core.Table(*numbers, _choice("method", _METHODS, method), _choice("outside", _OUTSIDE, outside))
    return each(lambda x, y: _look_up(table, x, y), x, y)
