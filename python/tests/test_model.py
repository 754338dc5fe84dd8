"""Models: how they are written, and what is refused."""

from __future__ import annotations

import pickle
from typing import Any

import numpy as np
import pytest
from conftest import Pmsm, cooling

import greybox as gb


def test_the_class_reads_as_the_librarys_own_motor() -> None:
    """The same graph, so that every answer has the same bits."""
    assert Pmsm(4).equations() == gb.pmsm.surface(pole_pairs=4)
    assert Pmsm(3).equations() != gb.pmsm.surface(pole_pairs=4)


def test_equations_print_and_pickle() -> None:
    equations = cooling().equations()
    assert str(equations) == "d(body)/dt = k * (room - body)\noutput body = body"
    assert repr(equations) == "<Equations: continuous, 1 states, 1 inputs, 1 outputs, 1 parameters>"
    assert pickle.loads(pickle.dumps(equations)) == equations
    assert equations.equations() is equations


def test_models_pickle() -> None:
    model = pickle.loads(pickle.dumps(Pmsm(4)))
    assert model.equations() == Pmsm(4).equations()


def test_dead_times() -> None:
    late = gb.model(
        lambda t, x, u, p: [p.k * u.early + u.late],
        delay=lambda p: {"early": 0.0, "late": p.theta},
        states=["z"],
        inputs=["early", "late"],
        outputs=["z"],
        parameters={"k": "1", "theta": "s"},
    )
    equations = late.equations()
    assert str(equations).endswith("output z = z\ndead time of late = theta")
    assert pickle.loads(pickle.dumps(equations)) == equations


def test_jumps() -> None:
    def sampled(t: gb.Symbol, x: gb.Vector, u: gb.Vector, p: gb.Vector) -> Any:
        return x.like(x=x.x + u.dose, z=x.z + p.k * (u.r - x.x))

    model = gb.model(
        lambda t, x, u, p: x.like(x=p.a * (x.z - x.x), z=0.0),
        jump=sampled,
        states={"x": "V", "z": "V"},
        inputs={"r": "V", "dose": "V"},
        outputs={"x": "V"},
        parameters={"a": "1/s", "k": "1"},
    )
    equations = model.equations()
    assert "x after a sample = x + dose" in str(equations)
    assert pickle.loads(pickle.dumps(equations)) == equations
    frame = {"t": np.arange(200) * 0.5, "r": np.where(np.arange(200) // 25 % 2, -0.5, 1.0), "dose": np.zeros(200)}
    frame["dose"][30] = 0.8
    made = gb.simulate(model, frame, parameters={"a": 0.6, "k": 0.4}, initial={"x": 0.0, "z": 0.0})
    # From sample to sample x follows z, which jumps, by a factor that is known.
    x, z, kept = 0.0, 0.0, np.exp(-0.3)
    for r, dose, found in zip(frame["r"], frame["dose"], made["x"], strict=True):
        assert abs(found - x) < 1e-4  # what one step of Runge-Kutta's method leaves
        x, z = x + dose, z + 0.4 * (r - x)
        x = z + (x - z) * kept
    with pytest.raises(gb.Error, match="jump and no derivative"):
        gb.model(next=lambda t, x, u, p: [x.a], jump=lambda t, x, u, p: [x.a], states=["a"], outputs=["a"]).equations()


@pytest.mark.parametrize(
    "returned",
    [
        lambda x: x.like(a=1.0, b=x.a),
        lambda x: {"b": x.a, "a": 1.0},
        lambda x: [1.0, x.a],
        lambda x: (1, x[0]),
        lambda x: np.array([1.0, x["a"]]),
        lambda x: np.stack([1.0, x.a]),
    ],
)
def test_all_ways_to_return_a_vector(returned: Any) -> None:
    model = gb.model(lambda t, x, u, p: returned(x), states=["a", "b"], outputs=["b"])
    assert str(model.equations()) == "d(a)/dt = 1.0\nd(b)/dt = a\noutput b = b"


def test_kinds() -> None:
    x = {"states": ["a"], "outputs": ["a"]}
    assert gb.model(lambda t, x, u, p: [x.a], **x).equations().kind == "continuous"
    assert gb.model(next=lambda t, x, u, p: [x.a], **x).equations().kind == "discrete"
    assert gb.model(output=lambda t, x, u, p: [u.a], inputs=["a"], outputs=["y"]).equations().kind == "static"


REFUSED: list[tuple[Any, str]] = [
    (lambda x: x.like(a=1.0), "lacks `b`; give each of a, b once"),
    (lambda x: x.like(a=1.0, b=2.0, c=3.0), "has `c`, which is not among them"),
    (lambda x: {"a": 1.0, "B": 2.0}, "lacks `b` and has `B`"),
    (lambda x: [1.0], "returns 1 value(s), but there are 2 to give: a, b"),
    (lambda x: 1.0, "returns 1 value(s)"),
    (lambda x: None, "returns nothing"),
    (lambda x: [1.0, np.zeros(3)], "the value of `b` has the shape (3,)"),
    (lambda x: [1.0, x.c], "there is no `c` among the states: a, b"),
    (lambda x: [1.0, x.a > 0], "gb.where(condition, 1.0, 0.0)"),
    (lambda x: [1.0, "x"], "'x'"),
]


@pytest.mark.parametrize("returned, says", REFUSED)
def test_wrong_returns_are_named(returned: Any, says: str) -> None:
    model = gb.model(lambda t, x, u, p: returned(x), states=["a", "b"], outputs=["b"])
    with pytest.raises(gb.Error) as raised:
        model.equations()
    assert says in str(raised.value)


def test_wrong_declarations_are_named() -> None:
    with pytest.raises(gb.Error, match="unit of `a` is 1"):
        gb.signals(a=1)  # type: ignore[arg-type]
    with pytest.raises(gb.Error, match="has states and neither"):
        gb.model(states=["a"], outputs=["a"]).equations()
    with pytest.raises(gb.Error, match="has no outputs"):
        gb.model(lambda t, x, u, p: [x.a], states=["a"]).equations()
    with pytest.raises(gb.Error, match="occurs twice"):
        gb.model(lambda t, x, u, p: [x.a], states=["a", "a"], outputs=["a"])
    with pytest.raises(gb.Error, match="output `y` is no state"):
        gb.model(lambda t, x, u, p: [x.a], states=["a"], outputs=["y"]).equations()
    with pytest.raises(gb.Error, match="write one"):
        gb.model(lambda t, x, u, p: [x.a], next=lambda t, x, u, p: [x.a], states=["a"], outputs=["a"]).equations()
    with pytest.raises(gb.Error, match="derivative of the model cannot be called with .t, x, u, p., which are handed over: too many"):
        gb.model(lambda t, x: [x.a], states=["a"], outputs=["a"]).equations()
    with pytest.raises(gb.Error, match="make one of it"):
        gb.fit(Pmsm, {})  # type: ignore[arg-type]
    with pytest.raises(gb.Error, match="the states are \\[3\\]; write states = gb.signals"):
        gb.model(lambda t, x, u, p: [x.a], states=3, outputs=["a"])  # type: ignore[arg-type]
    with pytest.raises(gb.Error, match="derivative of the model is 3; give a function of t, x, u, p"):
        gb.model(3, states=["a"], outputs=["a"]).equations()  # type: ignore[arg-type]
    with pytest.raises(gb.Error, match="derive a class"):
        gb.fit(3, {})  # type: ignore[arg-type]


def test_an_error_in_the_users_code_is_the_users() -> None:
    model = gb.model(lambda t, x, u, p: [1 / 0], states=["a"], outputs=["a"])
    with pytest.raises(ZeroDivisionError):
        model.equations()


def test_what_is_read_of_the_instance_is_of_the_time_of_the_fit() -> None:
    model = Pmsm(3)
    model.pole_pairs = 4
    assert model.equations() == gb.pmsm.surface(pole_pairs=4)
