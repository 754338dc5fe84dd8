"""Symbols: what Python and NumPy may do with them, and what is refused."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import greybox as gb

Read = Callable[..., float]

OF_ONE = [
    "abs", "cbrt", "ceil", "cos", "cosh", "deg2rad", "degrees", "exp", "exp2", "expm1", "fabs", "floor", "log", "log10", "log1p", "log2",
    "negative", "positive", "rad2deg", "radians", "reciprocal", "sign", "sin", "sinh", "sqrt", "square", "tan", "tanh", "trunc", "arcsinh",
    "arctan", "arcsin", "arccos", "arctanh",
]  # fmt: skip
OF_TWO = [
    "add", "subtract", "multiply", "divide", "power", "float_power", "remainder", "mod", "floor_divide", "arctan2", "hypot", "maximum",
    "minimum", "fmax", "fmin", "copysign", "heaviside",
]  # fmt: skip


def close(found: float, expected: float) -> None:
    """Library functions of two programs differ by a few units in the last place (4 units of 2.2e-16)."""
    assert found == pytest.approx(expected, rel=1e-15, abs=0.0), (found, expected)


@pytest.mark.parametrize("name", OF_ONE)
@pytest.mark.parametrize("value", [0.7, 0.25])
def test_functions_of_one_number_are_numpys(read: Read, name: str, value: float) -> None:
    function = getattr(np, name)
    close(read(lambda x, u, p: function(x), value), function(value))
    # In an array of symbols, NumPy calls the methods of the entries; for the sign it compares them.
    if name != "sign":
        close(read(lambda x, u, p: function(np.array([x, u]))[0], value), function(value))


@pytest.mark.parametrize("name", OF_TWO)
@pytest.mark.parametrize("pair", [(0.7, 0.4), (1.5, 2.0)])
def test_functions_of_two_numbers_are_numpys(read: Read, name: str, pair: tuple[float, float]) -> None:
    function = getattr(np, name)
    a, b = pair
    close(read(lambda x, u, p: function(x, u), a, b), function(a, b))
    close(read(lambda x, u, p: function(x, b), a), function(a, b))
    close(read(lambda x, u, p: function(a, u), 0.0, b), function(a, b))
    close(read(lambda x, u, p: function(np.float64(a), u), 0.0, b), function(a, b))


@pytest.mark.parametrize("value", [-1.7, -0.0, 0.0, 2.3])
def test_operators_are_pythons(read: Read, value: float) -> None:
    for expression in [
        lambda x: -x + 1,
        lambda x: +x - 2,
        lambda x: 2 - x,
        lambda x: 3 * x / 4,
        lambda x: 1 / (x + 10),
        lambda x: abs(x),
        lambda x: x**3,
        lambda x: x**2,
        lambda x: (x + 5) ** -1,
        lambda x: (x + 5) ** 0.5,
        lambda x: 2 ** (x + 1),
        lambda x: x % 1.5,
        lambda x: x % -1.5,
        lambda x: x // 0.5,
        lambda x: 7 // (x + 10),
    ]:
        # A power by multiplication is rounded once more.
        assert read(lambda x, u, p: expression(x), value) == pytest.approx(expression(value), rel=5e-16, abs=0.0)
    assert read(lambda x, u, p: np.sign(x), value) == np.sign(value)


@pytest.mark.parametrize("value", [-1.0, 0.0, 0.5, 1.0, 2.0])
def test_branches_take_the_side_of_the_value(read: Read, value: float) -> None:
    conditions: list[Callable[[Any], Any]] = [
        lambda x: x > 0,
        lambda x: x >= 1,
        lambda x: 1 <= x,
        lambda x: x < 0.5,
        lambda x: x == 0.5,
        lambda x: x != 0.5,
        lambda x: (x > 0) & (x < 1),
        lambda x: (x < 0) | (x > 1),
        lambda x: (x > 0) ^ (x > 1),
        lambda x: np.logical_not(x > 0) if not isinstance(x, float) else not x > 0,
        lambda x: np.logical_and(x > 0, x < 1),
        lambda x: (x > 0) & np.True_,
        lambda x: (x > 0) == (x > 1),
        lambda x: (x > 0) != (x > 1),
        lambda x: (x > 0) == True,  # noqa: E712
    ]
    for condition in conditions:
        expected = 3.0 if condition(value) else 4.0
        for where in (gb.where, np.where):
            assert read(lambda x, u, p: where(condition(x), 3.0, 4.0), value) == expected
    assert read(lambda x, u, p: np.clip(x, 0.0, 1.0), value) == np.clip(value, 0.0, 1.0)
    assert read(lambda x, u, p: np.clip(x, None, 0.7), value) == np.clip(value, None, 0.7)
    # Ends that cross at a value of a symbol: the upper one is the result, as NumPy has it.
    assert read(lambda x, u, p: np.clip(x, u, p), value, 1.0, 0.5) == np.clip(value, 1.0, 0.5) == 0.5
    chosen = np.select([value < 0, value < 1], [1.0, 2.0], 3.0)
    assert read(lambda x, u, p: np.select([x < 0, x < 1], [1.0, 2.0], 3.0), value) == chosen


@pytest.mark.parametrize("at", [-1.0, 0.0, 0.4, 1.0, 2.2, 9.0])
def test_tables_are_numpys(read: Read, at: float) -> None:
    xp, fp = [0.0, 1.0, 3.0], [0.0, 0.8, 1.2]
    expected = float(np.interp(at, xp, fp))
    # Two programs round the weights of a straight line apart.
    assert read(lambda x, u, p: np.interp(x, xp, fp), at) == pytest.approx(expected, abs=1e-15)
    assert read(lambda x, u, p: gb.interp(x, xp, fp), at) == gb.interp(at, xp, fp) == pytest.approx(expected, abs=1e-15)
    surface = np.add.outer(np.array(xp), 10 * np.array([0.0, 1.0]))
    expected = min(max(at, 0.0), 3.0) + 5.0
    assert read(lambda x, u, p: gb.interp2(x, u, xp, [0.0, 1.0], surface), at, 0.5) == pytest.approx(expected, abs=1e-14)


def test_vectors_and_matrices(read: Read) -> None:
    a = np.array([[1.0, 2.0], [3.0, 4.0]])
    assert read(lambda x, u, p: (a @ np.array([x, u]))[1], 5.0, 6.0) == 39.0
    assert read(lambda x, u, p: (a @ np.stack([x, u]))[1], 5.0, 6.0) == 39.0
    assert read(lambda x, u, p: (a * x)[1, 0], 5.0) == 15.0
    assert read(lambda x, u, p: np.stack(np.array([x, u]))[1], 5.0, 6.0) == 6.0
    assert read(lambda x, u, p: np.asarray(x) * u, 5.0, 6.0) == 30.0
    assert read(lambda x, u, p: (x - np.array([1.0, 2.0]))[1], 5.0) == 3.0
    assert read(lambda x, u, p: np.sum(np.array([x, u, p])), 1.0, 2.0, 4.0) == 7.0
    assert read(lambda x, u, p: np.dot([1.0, 2.0], np.hstack([x, [u]])), 5.0, 6.0) == 17.0
    assert read(lambda x, u, p: np.where(np.array([True, False]), x, u)[1], 5.0, 6.0) == 6.0
    model = gb.model(
        lambda t, x, u, p: a @ x + u[0], states=["a", "b"], inputs=["u"], outputs=["a"], parameters=[], output=lambda t, x, u, p: x[:1]
    )
    assert str(model.equations()).splitlines()[0] == "d(a)/dt = u + (a + b * 2.0)"
    summed = gb.model(lambda t, x, u, p: [np.sum(x), np.stack(x)[0]], states=["a", "b"], outputs=["a", "b"], parameters=[])
    assert str(summed.equations()).splitlines()[:2] == ["d(a)/dt = a + b", "d(b)/dt = a"]


@pytest.mark.parametrize("pair", [(-0.7, 0.4), (1.5, -2.0)])
def test_functions_of_arrays_of_symbols_are_those_of_their_entries(read: Read, pair: tuple[float, float]) -> None:
    numbers = np.array(pair)
    expressions: list[Callable[[Any, Any], Any]] = [
        *(lambda a, b, name=name: getattr(np, name)(a, 0.3) for name in OF_TWO if name not in ("power", "float_power")),
        *(lambda a, b, name=name: getattr(np, name)(b, a) for name in OF_TWO if name not in ("power", "float_power")),
        *(lambda a, b, name=name: getattr(np, name)(np.abs(a) / 3) for name in OF_ONE if name != "arccosh"),
        lambda a, b: np.sign(a),
        lambda a, b: np.clip(a, -0.2, 0.3),
        lambda a, b: np.clip(a, -0.2, b),
        lambda a, b: a.clip(-0.2, 0.3),
        lambda a, b: np.where(a > 0.3, a, 3.0),
        lambda a, b: np.where(a <= -a, a, 3.0),
        lambda a, b: np.where((a > -1) & ~(a == 0.4) & (b > 0), 3.0, 4.0),
        lambda a, b: np.where(np.logical_or(a > 0, b < 0), 3.0, 4.0),
        lambda a, b: np.maximum(np.array([[1.0, 2.0], [3.0, 4.0]]) @ a, 0.0),
        lambda a, b: np.maximum(np.concatenate([a, -a]), 0.0)[1:3],
        lambda a, b: np.maximum(np.stack([a, -a]), 0.0)[1],
        lambda a, b: np.sign(np.outer(a, a))[1],
        lambda a, b: np.stack([a.max(), np.min(a)]),
        lambda a, b: np.stack([np.where((a > -1).all(), 1.0, 2.0), np.where(np.any(a > 2), 1.0, 2.0)]),
        lambda a, b: np.max(np.stack([a, -a]), axis=0),
        lambda a, b: np.stack([a.sum(), a.mean()]),
        lambda a, b: np.sin(np.stack([a[0], 1.0])),
    ]
    for expression in expressions:
        expected = expression(numbers, 1.3)
        for k in (0, 1):
            # Powers by multiplication and remainders are rounded once more.
            found = read(lambda x, u, p: expression(np.stack([x, u]), p)[k], *pair, 1.3)
            assert found == pytest.approx(float(expected[k]), rel=4e-16, abs=1e-15), k

    def added(x: Any, u: Any, p: Any) -> Any:
        array = np.stack([x, u])
        array += 1.0
        array *= p
        return array[1]

    assert read(added, *pair, 2.0) == (pair[1] + 1.0) * 2.0


def test_functions_of_a_vector_are_those_of_its_entries() -> None:
    model = gb.model(
        lambda t, x, u, p: np.maximum(x, u.low) - np.where(x[:] > 1.0, x, 0.0), states=["a", "b"], inputs=["low"], outputs=["a"], parameters=[]
    )
    assert str(model.equations()).splitlines()[0].startswith("d(a)/dt = max(a, low) - ")
    assert "b" in str(model.equations()).splitlines()[1]


REFUSED: list[tuple[Callable[[Any, Any], Any], str]] = [
    (lambda x, u: np.maximum(np.array([x, u]), 0.0)[0], "np.stack([a, b])"),
    (lambda x, u: (np.array([x, u]) > 0.0)[0], "np.stack([a, b])"),
    (lambda x, u: np.sign(np.array([x, u]))[0], "np.stack([a, b])"),
    (lambda x, u: np.clip(np.array([x, u]), 0.0, 1.0)[0], "np.stack([a, b])"),
    (lambda x, u: np.copysign(np.array([x, u]), 1.0)[0], "np.stack([a, b])"),
    (lambda x, u: np.rint(np.stack([x, u]))[0], "np.rint is not known"),
    (lambda x, u: np.max(np.stack([x, u]), initial=0.0), "np.maximum.reduce with options"),
    (lambda x, u: np.linalg.solve(np.eye(2), np.array([x, u]))[0], "np.linalg.inv(A) @ x"),
    (lambda x, u: np.linalg.solve(np.eye(2), np.stack([x, u]))[0], "np.linalg.inv(A) @ x"),
    (lambda x, u: np.linalg.inv(np.array([[x, 1], [1, u]]))[0, 0], "np.linalg.inv(A) @ x"),
    (lambda x, u: np.linalg.det(np.array([[x, 1], [1, u]])), "the solution of a system in full"),
    (lambda x, u: np.interp(np.array([x, u]), [0, 1], [0, 1])[0], "np.stack([a, b])"),
    (lambda x, u: x & 1, "each in parentheses: (x > 0) & (x < 1)"),
    (lambda x, u: np.clip(x, 1, 0), "np.clip has 1.0 as its lower end and 0.0 as its upper one, which is then the result everywhere; exchange them"),
    (lambda x, u: np.clip(np.stack([x, u]), [0, 1], 0.5)[0], "np.clip has 1.0 as its lower end and 0.5"),
    (lambda x, u: 1 if x > 0 else 2, "gb.where"),
    (lambda x, u: 1 if x else 2, "gb.where"),
    (lambda x, u: x > 0 and x < 1, "gb.where"),
    (lambda x, u: 0 < x < 1, "gb.where"),
    (lambda x, u: not x, "gb.where"),
    (lambda x, u: max(x, u), "np.maximum"),
    (lambda x, u: float(x), "np.sin for math.sin"),
    (lambda x, u: int(x), "np.floor for int"),
    (lambda x, u: round(x), "np.floor"),
    (lambda x, u: list(range(x)), "ask a symbol for its value"),
    (lambda x, u: math.sin(x), "np.sin for math.sin"),
    (lambda x, u: len(x), "entries by name"),
    (lambda x, u: list(x), "entries by name"),
    (lambda x, u: 1.0 in x, "entries by name"),
    (lambda x, u: {1: 3.5}.get(x, 1.0), "gb.where(x == 1, a, b)"),
    (lambda x, u: 1.0 if x in {1, 2} else 0.0, "gb.where(x == 1, a, b)"),
    (lambda x, u: x + "1", "cannot be combined with '1' (str)"),
    (lambda x, u: x + None, "cannot be combined with None"),
    (lambda x, u: x + 1j, "cannot be combined with 1j (complex)"),
    (lambda x, u: (x > 0) + 1, "gb.where(condition, 1.0, 0.0)"),
    (lambda x, u: x * (x > 0), "gb.where(condition, 1.0, 0.0)"),
    (lambda x, u: (x > 0) & x, "in parentheses"),
    (lambda x, u: (x > 0) == 1.0, "in parentheses"),
    (lambda x, u: gb.where(x, 1, 2), "compare it with a number"),
    (lambda x, u: np.rint(x), "np.rint is not known"),
    (lambda x, u: np.add.reduce(x), "np.add.reduce"),
    (lambda x, u: np.add(x, 1, dtype=float), "call np.add(...) alone"),
    (lambda x, u: np.linalg.norm(x), "np."),
    (lambda x, u: np.interp(x, [0, 1], [0, 1], left=3), "left, right or period"),
    (lambda x, u: np.interp(1.0, np.array([x, u]), [0, 1]) if False else gb.interp(1.0, np.array([x, u]), [0, 1]), "fixed numbers"),
]


@pytest.mark.parametrize("expression, remedy", REFUSED)
def test_what_only_numbers_have_is_refused_with_line_and_remedy(
    read: Read, expression: Callable[[Any, Any], Any], remedy: str
) -> None:
    with pytest.raises(gb.TraceError) as raised:
        read(lambda x, u, p: expression(x, u), 1.0)
    text = str(raised.value)
    line = expression.__code__.co_firstlineno
    assert text.startswith(f"{__file__}, line {line}, in `(lambda x, u: "), text
    assert remedy in text, text


def test_writing_into_an_array_of_floats_is_refused(read: Read) -> None:
    def filled(x: Any, u: Any, p: Any) -> Any:
        array = np.zeros(2)
        array[0] = x
        return array[0]

    with pytest.raises(gb.TraceError, match="np.stack"):
        read(filled, 1.0)

    def added(x: Any, u: Any, p: Any) -> Any:
        array = np.zeros(2)
        array += x
        return array[0]

    with pytest.raises(gb.TraceError, match="write a = a \\+ b"):
        read(added, 1.0)


def test_symbols_of_another_reading_are_refused(read: Read) -> None:
    kept: list[Any] = []

    def keeping(x: Any, u: Any, p: Any) -> Any:
        kept.append(x)
        return x + kept[0]

    assert read(keeping, 2.0) == 4.0
    with pytest.raises(gb.TraceError, match="kept from another reading"):
        read(keeping, 2.0)
    with pytest.raises(gb.TraceError, match="kept from another reading"):
        read(lambda x, u, p: gb.where(kept[0] > 0, x, u), 2.0)
    with pytest.raises(gb.TraceError, match="kept from another reading"):
        kept[0] + 1


def test_a_condition_of_another_reading_is_refused(read: Read) -> None:
    kept: list[Any] = []
    read(lambda x, u, p: kept.append(x > 0) or x, 2.0)
    with pytest.raises(gb.TraceError, match="kept from another reading"):
        read(lambda x, u, p: gb.where(kept[0], x, u), 2.0)


def test_slopes_do_not_cross_branches() -> None:
    """The side that is not taken has an infinite slope; the fit gets those of the side that is."""
    t = np.arange(400) * 0.1
    u = np.sin(t)
    y = 2.0 * np.where(u > 0, np.sqrt(np.abs(u)), 0.0) + np.random.default_rng(1).normal(0.0, 1e-3, 400)
    model = gb.model(
        output=lambda t, x, u, p: [gb.where(u.u > 0, p.a * gb.sqrt(u.u), 0 * p.a)], inputs=["u"], outputs=["y"], parameters=["a"]
    )
    found = gb.fit(model, {"t": t, "u": u, "y": y}, a=gb.free(1.0))
    # Five standard errors: 1e-3 over the root of 400 mean squares of the slope, which are 0.3.
    assert found.parameters.a == pytest.approx(2.0, abs=5 * 1e-3 / np.sqrt(400 * 0.3))
