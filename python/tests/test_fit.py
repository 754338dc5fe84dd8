"""Fits: numbers, options, verdicts, errors."""

from __future__ import annotations

import os
import pickle
import re
import subprocess
import sys
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from conftest import DATA, Pmsm, cooled, cooling

import greybox as gb

TRUTH = {"rs": 0.63, "ls": 4e-3, "ke": 0.95}


def test_the_motor_of_the_readme(fitted: gb.Fit) -> None:
    # The numbers that the README of the library shows, to its digits.
    assert f"{fitted.parameters.rs:.5f} {fitted.parameters.ls:.7f} {fitted.parameters.ke:.6f}" == "0.63032 0.0040005 0.949977"
    assert fitted.verdict == "usable" and fitted.converged and fitted.outcome.startswith("converged")
    for name, truth in TRUTH.items():
        lower, upper = fitted.interval(name, 0.99)
        assert lower < truth < upper
    assert str(fitted).startswith("Verdict: usable.") and repr(fitted) == str(fitted)
    assert fitted.engine.startswith("read as a graph")
    assert fitted.unknowns == ["rs", "ls", "ke", "id(0)", "iq(0)"]


def test_the_class_and_the_librarys_motor_have_the_same_bits(
    fitted: gb.Fit, motor: pd.DataFrame, declared: dict[str, gb.Parameter]
) -> None:
    ours = gb.fit(gb.pmsm.surface(pole_pairs=4), motor, **declared)
    a, b = fitted.to_dict(), ours.to_dict()
    assert a.pop("seconds") != 0 and b.pop("seconds") != 0
    assert a == b


def test_covariance(fitted: gb.Fit) -> None:
    errors = np.sqrt(np.diag(fitted.covariance))
    assert errors[0] == pytest.approx(fitted.standard_errors.rs, rel=1e-12)
    scaled = fitted.covariance / np.outer(errors, errors)
    assert np.allclose(scaled, fitted.correlation, atol=1e-12)


def test_options_reach_the_library(motor: pd.DataFrame, declared: dict[str, gb.Parameter]) -> None:
    def method(**said: Any) -> dict[str, Any]:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", gb.FitWarning)
            found: dict[str, Any] = gb.fit(Pmsm(4), motor, **declared, **said).to_dict()["method"]
        return found

    assert "Runge-Kutta 4, 2 steps" in method(integrator="rk4:2")["integrator"]
    assert method(loss="huber:2")["loss"] == "Huber(2.0)"
    assert method(noise={"id": 0.05, "iq": 0.05})["noise"] == "given"
    assert method(noise="covariance")["noise"] == "covariance"
    # One input has noise, the others none.
    assert method(input_noise={"w": 0.1})["noise"] == "per_output"
    assert "5" in method(predictor="horizon:5")["predictor"]
    assert "Gauss-Newton" in method(optimizer="gauss-newton")["optimizer"]
    assert "Butterworth" in method(prefilter="low-pass:2,500")["prefilter"]
    assert method(weighting=lambda t, u, y: abs(u.w))["weighting"] != "none"


def test_noise_that_is_not_given_is_estimated(motor: pd.DataFrame, declared: dict[str, gb.Parameter]) -> None:
    def sigmas(**said: Any) -> list[float]:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", gb.FitWarning)
            found: list[dict[str, Any]] = gb.fit(Pmsm(4), motor, **declared, **said).to_dict()["outputs"]
        return [one["fit"]["sigma"] for one in found]

    estimated = sigmas()
    # Both are 0.05 in truth.
    assert estimated == pytest.approx([0.05, 0.05], rel=0.05)
    given, other = sigmas(noise={"id": 0.1})
    assert given == 0.1 and other == pytest.approx(estimated[1], rel=1e-3)
    assert sigmas(noise={}) == estimated


def test_states_that_are_not_said_are_estimated(motor: pd.DataFrame, declared: dict[str, gb.Parameter]) -> None:
    with warnings.catch_warnings():
        # The current is not 0.25 A.
        warnings.simplefilter("ignore", gb.FitWarning)
        found = gb.fit(Pmsm(4), motor, initial={"iq": gb.fixed(0.25)}, **declared)
        both = gb.fit(Pmsm(4), motor, initial={"id": gb.free(0.0), "iq": gb.fixed(0.25)}, **declared)
    assert found.to_dict()["experiments"] == both.to_dict()["experiments"]
    assert found.to_dict()["experiments"][0]["initial_state"][1] == 0.25
    assert [name for name in found.unknowns if name not in declared] == ["id(0)"]
    assert gb.fit(Pmsm(4), motor, initial={}, **declared).unknowns == gb.fit(Pmsm(4), motor, **declared).unknowns


def test_weighting_is_an_expression() -> None:
    """Samples of weight zero do not count, whatever they say."""
    c = cooled()
    wrong = {**c, "body": np.where(c["t"] > 10, c["body"] + 5, c["body"])}
    half = {name: column[:101] for name, column in c.items()}
    said: dict[str, Any] = {"k": gb.free(1.0), "initial": {"body": gb.fixed(80.0)}, "noise": {"body": 0.05}}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", gb.FitWarning)
        weighted = gb.fit(cooling(), wrong, weighting=lambda t, u, y: gb.where(t <= 10, 1.0, 0.0), **said)
        short = gb.fit(cooling(), half, **said)
    # Two searches that each stop at a relative step of 1e-10.
    assert weighted.parameters.k == pytest.approx(short.parameters.k, rel=1e-9)


def test_several_records_and_their_own_parameters() -> None:
    cold, warm = gb.Record(cooled(k=0.3), name="cold"), gb.Record(cooled(k=0.5, seed=2), name="warm")
    found = gb.fit(cooling(), [cold, warm], k=gb.free(1.0, per_experiment=True))
    values = [one["parameters"][0] for one in found.to_dict()["experiments"]]
    assert values == pytest.approx([0.3, 0.5], rel=0.01)
    frame = pd.DataFrame(found.to_dataframe())
    assert frame["record"].unique().tolist() == ["cold", "warm"] and len(frame) == 400
    assert np.allclose(frame["body"] - frame["body_predicted"], frame["body_residual"], atol=0)
    assert frame["body_residual"].std() == pytest.approx(0.05, rel=0.1)
    # Of a frame nobody knows which of the two it is; a record of the name of one has its parameter.
    named = found.residuals(warm)["body"]
    assert float(np.std(np.asarray(named))) == pytest.approx(0.05, rel=0.1)
    with pytest.raises(gb.Error, match="a value for each record of the fit, and this is none of them \\(cold, warm;"):
        found.predict(cooled(k=0.5, seed=2))
    with pytest.raises(gb.Error, match="say which by record="):
        found.derived("tau", lambda p: 1 / p.k)
    assert found.derived("tau", lambda p: 1 / p.k, record="warm").value == pytest.approx(1 / values[1], rel=1e-12)
    names = set(pd.DataFrame(found.table())["name"])
    assert {"k [cold]", "k [warm]"} <= names and "k" not in names


def test_remedies_are_arguments() -> None:
    c = cooled()
    c["room"] = np.where(c["t"] < 5, np.nan, c["room"])
    with pytest.raises(gb.Error, match=r"an input that has a rate of its own \(gb.align\)"):
        gb.fit(cooling(), c, k=gb.free(1.0))


def test_derived(fitted: gb.Fit) -> None:
    tau = fitted.derived("tau", lambda p: p.ls / p.rs)
    assert tau.value == fitted.parameters.ls / fitted.parameters.rs
    g = np.array([-tau.value / fitted.parameters.rs, 1 / fitted.parameters.rs])
    assert tau.standard_error == pytest.approx(float(np.sqrt(g @ fitted.covariance[:2, :2] @ g)), rel=1e-9)
    assert tau.lower < tau.value < tau.upper
    with pytest.raises(gb.Error, match="the derived quantity is 'k'; give a function of p"):
        fitted.derived("tau", "k")  # type: ignore[arg-type]


def test_warnings_have_codes() -> None:
    c = cooled()
    c["body"] = c["body"] + np.sin(c["t"])
    with pytest.warns(gb.FitWarning) as caught:
        found = gb.fit(cooling(), c, k=gb.free(1.0))
    assert all(one.filename == __file__ for one in caught)
    codes = [one.message.code for one in caught]  # type: ignore[union-attr]
    assert "colored_errors" in codes and found.verdict != "usable"
    assert str(caught[0].message).startswith(f"[{codes[0]}] ")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.filterwarnings("ignore", r"\[[a-z_]+\]", gb.FitWarning)
        gb.fit(cooling(), c, k=gb.free(1.0))


WRONG: list[tuple[dict[str, Any], str]] = [
    ({}, "parameter `k` is not declared; write k=gb.free(start)"),
    ({"k": 1.0}, "write gb.free(1.0) to estimate it from there, or gb.fixed(1.0)"),
    ({"k": gb.free(1.0), "kk": gb.free(1.0)}, "there is no parameter `kk`; the model has: k"),
    ({"k": gb.free(1.0), "parameters": {"k": gb.free(1.0)}}, "declared twice"),
    ({"k": gb.free(1.0), "integrater": "rk4"}, "there is no option `integrater`"),
    ({"k": gb.free(1.0), "integrator": "rk5"}, "rk4"),
    ({"k": gb.free(1.0), "integrator": 4}, "give its name as text"),
    ({"k": gb.free(1.0), "loss": "hubber"}, "huber"),
    ({"k": gb.free(1.0), "predictor": "horizon"}, "whole number"),
    ({"k": gb.free(1.0), "hold": "linear"}, "there is no hold `linear`"),
    ({"k": gb.free(1.0), "hold": {"rom": "first"}}, "rom"),
    ({"k": gb.free(1.0), "initial": "zero"}, "there is no initial state `zero`"),
    ({"k": gb.free(1.0), "initial": {"body": 80.0}}, "write gb.free(80.0)"),
    ({"k": gb.free(1.0), "initial": {"bdy": gb.fixed(80.0)}}, "there is no initial state of `bdy`"),
    ({"k": gb.free(1.0), "noise": {"bdy": 0.1}}, "noise names `bdy`"),
    ({"k": gb.free(1.0), "noise": "full"}, "covariance"),
    ({"k": gb.free(1.0), "noise": "covariance", "predictor": "kalman"}, "noise='covariance' has no effect on the predictor kalman"),
    ({"k": gb.free(1.0), "noise": {"body": 0.1}, "predictor": "second-order:stationary"}, "no effect on the predictor second-order"),
    ({"k": gb.free(1.0), "time": "t", "sample_time": 0.1}, "time='t' and sample_time=0.1 both give the time of the samples; leave one out"),
    ({"k": gb.free(1.0), "columns": {"t": "t"}, "sample_time": 0.1}, "columns={'t': 't'} and sample_time=0.1 both give the time"),
    ({"k": gb.free(1.0), "columns": {"t": "t"}, "time": "t"}, "columns={'t': 't'} and time='t' both give the time"),
    ({"k": gb.free(1.0), "noise": {"body": -1.0}}, "must be positive"),
    ({"k": gb.free(1.0), "starts": 0}, "starts is 0"),
    ({"k": gb.free(1.0), "time_limit": -1.0}, "time limit"),
    ({"k": gb.free(1.0), "columns": {"rom": "room"}}, "columns names `rom`"),
    ({"k": gb.fixed(1.0), "initial": {"body": gb.fixed(80.0)}}, "nothing is free"),
    ({"k": gb.free(float("nan"))}, "not a number"),
    ({"k": gb.free(5.0, within=(0.0, 1.0))}, "k"),
    ({"k": gb.free(1.0), "weighting": lambda t, u, y: -1.0}, "weighting"),
    ({"k": gb.free(1.0), "weighting": lambda t, u, y: 1 if t > 3 else 0}, "gb.where"),
    ({"k": gb.free(1.0), "weighting": 3.0}, "the weighting is 3.0; give a function of t, u, y"),
    ({"k": gb.free(1.0), "weighting": lambda u, y: u.room}, "the weighting cannot be called with (t, u, y), which are handed over: too many"),
    ({"k": gb.free(1.0), "starts": 2**70}, "starts is 1180591620717411303424; take a whole number of 1000000000 or less"),
    ({"k": gb.free(1.0), "starts": 1.5}, "starts is 1.5; take a whole number of 1 or more"),
    ({"k": gb.free(1.0), "sample_time": "0.1"}, "sample_time is '0.1'; give a number"),
    ({"k": gb.free(1.0), "sample_time": -0.1}, "the sample time is -0.1; it must be positive and finite (s)"),
    ({"k": gb.free(1.0), "time": 0}, "there is no column `0` for the time; the frame has: t, room, body"),
    ({"k": gb.free(1.0), "time": [0.0, 0.1]}, "time is [0.0, 0.1]; give the name of a column"),
    ({"k": gb.free(1.0), "columns": {"room": None}}, "the column of `room` is None; give the name of a column"),
    ({"k": gb.free(1.0), "columns": "room"}, "columns is 'room'; give the column of each signal"),
    ({"k": gb.free(1.0), "time_limit": "5"}, "time_limit is '5'; give a number"),
    ({"k": gb.free(1.0), "time_limit": float("nan")}, "time limit"),
    ({"k": gb.free(1.0), "noise": {"body": "a"}}, "`body` of noise is 'a'; give a number"),
    ({"k": gb.free(1.0), "noise": {"body": float("nan")}}, "must be positive"),
    ({"k": gb.free(1.0), "noise": np.full(1, 0.1)}, 'noise is array([0.1]); give a standard deviation for each by its name: {"body": 0.1}'),
    ({"k": gb.free(1.0), "input_noise": {"room": None}}, "`room` of input_noise is None; give a number"),
    ({"k": gb.free(1.0), "staged": "no"}, "staged is 'no'; take True or False"),
    ({"k": gb.free(1.0), "multiple_shooting": 1}, "multiple_shooting is 1; take True or False"),
    ({"k": gb.free(1.0), "checkpoint": 3}, "checkpoint is 3; give the path of a file"),
    ({"k": gb.free(1.0), "predictor": 5}, "predictor is 5; give its name as text"),
    ({"k": gb.free(1.0), "hold": 3}, 'hold is 3; give "zero", "first", or one of them for each input by its name'),
    ({"k": gb.free(1.0), "hold": {"room": 1}}, "hold of `room` is 1; give its name as text"),
    ({"k": gb.free(1.0), "initial": np.zeros(2)}, "initial state of array([0., 0.]): give the declaration of each by its name"),
    ({"parameters": [gb.free(1.0)]}, "parameters is [free(1.0)]; give the declaration of each by its name"),
]


@pytest.mark.parametrize("said, says", WRONG)
def test_what_is_wrong_with_options_is_named(said: dict[str, Any], says: str) -> None:
    with pytest.raises(gb.Error) as raised:
        gb.fit(cooling(), cooled(), **said)
    assert says in str(raised.value), raised.value


def test_a_parameter_with_the_name_of_an_option() -> None:
    model = gb.model(
        lambda t, x, u, p: [p.noise * (u.room - x.body)], states=["body"], inputs=["room"], outputs=["body"], parameters=["noise"]
    )
    found = gb.fit(model, cooled(), parameters={"noise": gb.free(1.0)})
    assert found.parameters.noise == pytest.approx(0.3, rel=0.01)


def test_pickles(fitted: gb.Fit, motor: pd.DataFrame) -> None:
    again = pickle.loads(pickle.dumps(fitted))
    assert str(again) == str(fitted)
    assert again.predict().equals(fitted.predict())
    assert again.predict(motor).equals(fitted.predict(motor))
    assert str(again.report()) == str(fitted.report())
    report = fitted.report()
    assert pickle.loads(pickle.dumps(gb.free(1.0, within=(0, 2), log=True))) == gb.free(1.0, within=(0, 2), log=True)
    assert pickle.loads(pickle.dumps(report)).to_html() == report.to_html()


def test_models_of_functions_are_pickled_as_what_they_are_read_as() -> None:
    model = cooling()
    again = pickle.loads(pickle.dumps(model))
    assert again == model.equations()
    assert gb.fit(again, cooled(), k=gb.free(1.0)).parameters.k == gb.fit(model, cooled(), k=gb.free(1.0)).parameters.k
    same = pickle.loads(pickle.dumps(Pmsm(4)))
    assert isinstance(same, Pmsm) and same.equations() == Pmsm(4).equations()


def test_pickles_of_irregular_time_and_given_states() -> None:
    t = np.arange(200) * 0.1 + 1e-3 * np.sin(np.arange(200))
    c = {"t": t, "room": 20 + 10 * np.sin(0.9 * t)}
    c = gb.simulate(cooling(), c, parameters={"k": 0.3}, initial={"body": 80.0}, noise={"body": 0.05}, hold="first", integrator="rk4:4")
    said: dict[str, Any] = {"initial": {"body": gb.free(80.0, prior=(80.0, 1.0))}, "weighting": lambda t, u, y: 1 + 0 * t}
    found = gb.fit(cooling(), c, hold={"room": "first"}, k=gb.free(1.0), **said)
    again = pickle.loads(pickle.dumps(found))
    assert again.to_dataframe()["body_predicted"].tolist() == found.to_dataframe()["body_predicted"].tolist()


def test_simulate_is_the_record_that_it_makes() -> None:
    t = np.arange(0, 10, 0.05)
    u = {"t": t, "room": 20 + 5 * np.sign(np.sin(t))}
    clean = gb.simulate(cooling(), pd.DataFrame(u), parameters={"k": 0.3}, initial={"body": 80.0})
    assert list(clean.columns) == ["t", "room", "body"] and clean["body"][0] == 80.0
    noisy = gb.simulate(cooling(), u, parameters={"k": 0.3}, initial={"body": 80.0}, noise={"body": 0.1}, seed=7)
    assert np.std(noisy["body"] - clean["body"]) == pytest.approx(0.1, rel=0.2)
    assert gb.fit(cooling(), noisy, k=gb.free(1.0)).parameters.k == pytest.approx(0.3, rel=0.01)
    for said, says in [
        ({"parameters": {}}, "parameter `k` has no value"),
        ({"parameters": {"k": 1.0, "l": 2.0}}, "parameters names `l`"),
        ({"parameters": {"k": 1.0}, "initial": {"b": 2.0}}, "initial names `b`"),
        ({"parameters": {"k": float("nan")}}, "not a number"),
        ({"parameters": 0.3}, "parameters is 0.3; give a value for each by its name: {\"k\": 0.1}"),
        ({"parameters": {"k": gb.fixed(0.3)}}, "`k` of parameters is fixed(0.3); give a number"),
        ({"parameters": {"k": 1.0}, "initial": np.full(1, 80.0)}, "initial is array([80.]); give a value for each by its name"),
        ({"parameters": {"k": 1.0}, "initial": {"body": None}}, "`body` of initial is None; give a number"),
        ({"parameters": {"k": 1.0}, "noise": 0.1}, "noise is 0.1; give a standard deviation for each by its name: {\"body\": 0.1}"),
        ({"parameters": {"k": 1.0}, "noise": {"body": float("nan")}}, "`body` of noise is nan; give a finite standard deviation of zero or more"),
        ({"parameters": {"k": 1.0}, "noise": {"body": -0.1}}, "`body` of noise is -0.1; give a finite standard deviation of zero or more"),
        ({"parameters": {"k": 1.0}, "seed": -1}, "seed is -1; take a whole number of 0 or more"),
        ({"parameters": {"k": 1.0}, "seed": 2**64}, "seed is 18446744073709551616; take a whole number of 18446744073709551615 or less"),
        ({"parameters": {"k": 1.0}, "seed": 0.5}, "seed is 0.5; take a whole number of 0 or more"),
        ({"parameters": {"k": 1.0}, "integrator": 4}, "integrator is 4; give its name as text"),
        ({"parameters": {"k": 1.0}, "time": 0}, "there is no column `0` for the time"),
    ]:
        with pytest.raises(gb.Error, match=re.escape(says)):
            gb.simulate(cooling(), u, **said)


def test_the_noise_of_the_model_is_simulated_where_it_is_asked_for() -> None:
    u = {"t": np.arange(50) * 0.1, "room": np.full(50, 20.0)}
    parts: dict[str, Any] = {"states": ["body"], "inputs": ["room"], "outputs": ["body"], "parameters": ["k"]}
    noisy = gb.model(
        lambda t, x, u, p: [p.k * (u.room - x.body)], diffusion=lambda t, x, u, p: [5.0], noise=lambda t, x, u, p: [2.0], **parts
    )
    said: dict[str, Any] = {"parameters": {"k": 0.3}, "initial": {"body": 80.0}, "integrator": "rk4:4"}
    clean = gb.simulate(cooling(), u, **said)["body"]
    assert (gb.simulate(noisy, u, **said, seed=7)["body"] == clean).all()
    assert (gb.simulate(noisy, u, **said, noise={"body": 0.1})["body"] == gb.simulate(cooling(), u, **said, noise={"body": 0.1})["body"]).all()
    # Process noise of 5 K per root of a second, then the noise of the output, which is drawn as that of `noise`.
    moved = gb.simulate(noisy, u, **said, noisy=True, noise={"body": 0.0}, seed=7)["body"]
    both = gb.simulate(noisy, u, **said, noisy=True, seed=7)["body"]
    drawn = gb.simulate(cooling(), u, **said, noise={"body": 2.0}, seed=7)["body"]
    # Rounding of sums of numbers below 128.
    assert np.abs((both - moved) - (drawn - clean)).max() < 1e-12
    steps = np.diff(moved - clean * 1.0) + 0.3 * 0.1 * (moved - clean)[:-1]
    # 5 sqrt(0.1), of 49 numbers within four deviations.
    assert abs(steps.std() / (5.0 * np.sqrt(0.1)) - 1.0) < 4.0 / np.sqrt(2 * 49)
    with pytest.raises(gb.Error, match="noisy is 1; take True or False"):
        gb.simulate(noisy, u, **said, noisy=1)  # type: ignore[arg-type]


DECLARED: list[tuple[Callable[[], Any], str]] = [
    (lambda: gb.free("1.0"), "start is '1.0'; give a number"),  # type: ignore[arg-type]
    (lambda: gb.free(1.0, within=(0.1,)), "within is (0.1,); give two numbers: within=(0.1, 10.0)"),  # type: ignore[arg-type]
    (lambda: gb.free(1.0, within=3.0), "within is 3.0; give two numbers"),  # type: ignore[arg-type]
    (lambda: gb.free(1.0, prior=(1.0, None)), "the second number of prior is None; give a number"),  # type: ignore[arg-type]
    (lambda: gb.free(1.0, log=1.0), "log is 1.0; take True or False"),  # type: ignore[arg-type]
    (lambda: gb.fixed(None), "the value of gb.fixed is None; give a number"),  # type: ignore[arg-type]
    (lambda: gb.pmsm.surface(pole_pairs=2**40), "pole_pairs is 1099511627776; take a whole number of 1000000000 or less"),
    (lambda: gb.Record({}, name=3), "the name of the record is 3; give its name as text"),  # type: ignore[arg-type]
]


@pytest.mark.parametrize("declare, says", DECLARED)
def test_what_is_wrong_with_a_declaration_is_named(declare: Callable[[], Any], says: str) -> None:
    with pytest.raises(gb.Error) as raised:
        declare()
    assert says in str(raised.value), raised.value
    # Bounds may be a list.
    assert gb.free(1.0, within=[0.1, 10]) == gb.free(1.0, within=(0.1, 10.0))  # type: ignore[arg-type]


def test_parameters_with_the_names_of_other_unknowns_are_refused() -> None:
    parts: dict[str, Any] = {"states": ["body"], "inputs": ["room"], "outputs": ["body"]}
    taken = gb.model(lambda t, x, u, p: [p[0] * (u.room - x.body)], **parts, parameters=["body(0)"])
    with pytest.raises(gb.Error, match=r"parameter `body\(0\)`, which is the name of the state at the first sample; rename the parameter"):
        gb.fit(taken, cooled(), parameters={"body(0)": gb.free(1.0)})
    two = [gb.Record(cooled(), name="cold"), gb.Record(cooled(seed=2), name="warm")]
    for name in ("k [cold]", "body(0) [warm]"):
        model = gb.model(lambda t, x, u, p: [p.k * p[1] * (u.room - x.body)], **parts, parameters=["k", name])
        said = {"k": gb.free(1.0, per_experiment=True), name: gb.fixed(1.0)}
        with pytest.raises(gb.Error, match=f"parameter `{re.escape(name)}` has the name of an unknown of one record; rename"):
            gb.fit(model, two, parameters=said)
        assert gb.fit(model, two[0], parameters={**said, "k": gb.free(1.0)}).parameters.k == pytest.approx(0.3, rel=0.01)


INTERRUPTED = """
import os, signal, threading, warnings
import numpy as np
import greybox as gb
n = 400_000
t = np.arange(n) * 1e-3
u = np.sign(np.sin(t))
# A pendulum whose integrator chooses its steps: each pass over the record takes a second or more.
model = gb.model(lambda t, x, u, p: [x.w, p.a * np.sin(x.q) * -1 - p.b * x.w + u.u], states=["q", "w"], inputs=["u"], outputs=["q"],
                 parameters=["a", "b"])
record = gb.simulate(model, {"t": t, "u": u}, parameters={"a": 3.0, "b": 0.3}, noise={"q": 0.01})
threading.Timer(SECONDS, lambda: os.kill(os.getpid(), signal.SIGINT)).start()
with warnings.catch_warnings():
    warnings.simplefilter("ignore")
    found = gb.fit(model, record, a=gb.free(2.0), b=gb.free(0.5), integrator="rk45:1e-10", starts=40)
print(found.outcome, "|", found.verdict, "|", found.converged)
"""


def test_ctrl_c_returns_the_best_so_far_and_other_threads_run_meanwhile() -> None:
    """The timer that interrupts is a thread of Python, which runs because a fit does not hold Python's lock."""
    program = INTERRUPTED.replace("SECONDS", "4.0")
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=300, check=False)
    # Where even the start was not evaluated, there is no best, and the interrupt is raised.
    assert done.stdout.strip() == "cancelled | not usable | False" or "KeyboardInterrupt" in done.stderr, (done.stdout, done.stderr)


FORKED = """
import multiprocessing, sys
sys.path.insert(0, TESTS)
from conftest import cooled, cooling
import greybox as gb
fit = gb.fit(cooling(), cooled(), k=gb.free(1.0))
draw = lambda: str(fit.bootstrap(20, seed=1).table())
here = draw()
context = multiprocessing.get_context("fork")
ends, end = context.Pipe()
child = context.Process(target=lambda: end.send([draw(), draw()]))
child.start()
print(ends.poll(60) and ends.recv() == [here, here])
child.kill()
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="processes are not forked here")
def test_a_forked_process_has_threads_of_its_own() -> None:
    program = FORKED.replace("TESTS", repr(str(Path(__file__).parent)))
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=300, check=False)
    assert done.stdout.strip() == "True", (done.stdout, done.stderr)


def test_progress(capsys: pytest.CaptureFixture[str]) -> None:
    gb.fit(Pmsm(4), pd.read_csv(DATA / "pmsm.csv"), rs=gb.free(1.0), ls=gb.free(2e-3), ke=gb.free(0.7), progress=True)
    assert "fit" in capsys.readouterr().err
