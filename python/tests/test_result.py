"""Results: tables, predictions, reports, profiles, plots."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from conftest import cooled, cooling

import greybox as gb


def test_table(fitted: gb.Fit) -> None:
    table = fitted.table()
    assert isinstance(table, pd.DataFrame)
    assert table["name"].tolist() == ["rs", "ls", "ke", "id(0)", "iq(0)"]
    assert table["unit"].tolist() == ["ohm", "H", "V s/rad", "A", "A"]
    assert table["value"][0] == fitted.parameters.rs and table["standard_error"][0] == fitted.standard_errors.rs
    assert (table["lower"] < table["value"]).all() and (table["value"] < table["upper"]).all()
    assert table["knowledge"].eq("known").all() and table["index_percent"][0] == pytest.approx(2.11, abs=0.005)


def test_what_is_not_known_is_not_shown_as_known() -> None:
    with pytest.warns(gb.FitWarning):
        model = gb.model(
            lambda t, x, u, p: [p.a * p.b * (u.room - x.body)], states=["body"], inputs=["room"], outputs=["body"], parameters=["a", "b", "c"]
        )
        found = gb.fit(model, cooled(), a=gb.free(1.0), b=gb.free(1.0), c=gb.fixed(2.0))
    assert np.isnan([found.standard_errors.a, found.standard_errors.b, found.standard_errors.c]).all()
    assert list(found.table()["knowledge"])[:3] == ["unidentified", "unidentified", "fixed"]
    with pytest.raises(gb.Error, match="has no interval"):
        found.interval("a")
    with pytest.raises(gb.Error, match="there is no unknown `aa`"):
        found.interval("aa")
    with pytest.raises(AttributeError, match="there is no `aa` among the parameters: a, b, c"):
        found.parameters.aa  # noqa: B018
    assert "unidentified" in found._repr_html_()


def test_predictions(fitted: gb.Fit, motor: pd.DataFrame) -> None:
    frame = fitted.to_dataframe()
    assert list(frame.columns) == ["t", "ud", "uq", "w", "id", "iq", "id_predicted", "iq_predicted", "id_residual", "iq_residual"]
    assert (frame["id"] - frame["id_predicted"] == frame["id_residual"]).all()
    assert np.sqrt((frame["id_residual"] ** 2).mean()) == pytest.approx(0.05024, abs=5e-6)
    assert fitted.predict().equals(frame[["t", "id_predicted", "iq_predicted"]].rename(columns=lambda name: name.removesuffix("_predicted")))
    # With the initial state estimated anew, which it is to the search's precision.
    other = fitted.residuals(motor)
    assert np.abs(other["id"] - frame["id_residual"]).max() < 1e-6
    half = fitted.predict(motor.drop(columns=["id", "iq"]), initial={"id": gb.fixed(0.0), "iq": gb.fixed(0.0)})
    assert len(half) == len(motor) and half["id"][0] == 0.0
    with pytest.raises(gb.Error, match="missing in every sample"):
        fitted.predict(motor.drop(columns=["id", "iq"]))


def test_states() -> None:
    rng = np.random.default_rng(3)
    level = np.cumsum(0.1 * rng.normal(size=300))
    frame = pd.DataFrame({"t": np.arange(300.0), "y": level + 0.3 * rng.normal(size=300)})
    model = gb.model(
        next=lambda t, x, u, p: [x.level], output=lambda t, x, u, p: [x.level], diffusion=lambda t, x, u, p: [p.q],
        noise=lambda t, x, u, p: [p.r], initial_noise=lambda p: [1.0], states=["level"], outputs=["y"], parameters=["q", "r"],
    )
    start = {"q": gb.free(0.2, log=True), "r": gb.free(0.2, log=True)}
    found = gb.fit(model, frame, parameters=start, time="t", initial={"level": gb.fixed(0.0)}, predictor="kalman")
    assert found.log_likelihood == pytest.approx(-0.5 * found.to_dict()["deviance"], rel=1e-12)
    filtered, smoothed = found.filtered(), found.smoothed()
    assert list(smoothed.columns) == ["t", "level", "level_deviation"] and len(smoothed) == 300
    # The last sample has nothing after it; before it, less is left.
    assert smoothed["level"].iloc[-1] == pytest.approx(filtered["level"].iloc[-1], abs=1e-12)
    assert (smoothed["level_deviation"][:-1] < filtered["level_deviation"][:-1]).all()
    # Of 300 correlated samples.
    inside = (np.abs(smoothed["level"] - level) < 1.96 * smoothed["level_deviation"]).mean()
    assert inside > 0.85
    assert found.smoothed(frame, time="t", initial={"level": gb.fixed(0.0)}).equals(smoothed)
    test = found.process_noise()
    assert test.levels == ["q"] and test.degrees_of_freedom == 1
    assert test.likelihood_ratio > 100.0 and test.p_value < 1e-20
    report = found.report()
    assert "States: " in str(report) and "the plant is disturbed" in report.to_markdown().replace("\n", " ")
    # A simulation explains nothing of a walk.
    with pytest.warns(gb.FitWarning):
        simulated = gb.fit(model, frame, parameters=start | {"q": gb.fixed(0.1)}, time="t")
    with pytest.raises(gb.Error, match="Kalman"):
        simulated.smoothed()
    with pytest.raises(gb.Error, match="no process noise to test"):
        simulated.process_noise()


def test_reports(fitted: gb.Fit, tmp_path: Path) -> None:
    report = fitted.report(tmp_path / "r.html", title="Motor 7", profiles=["rs"])
    page = (tmp_path / "r.html").read_text()
    assert page == report.to_html() and "Motor 7" in page
    assert "Motor 7" in str(report) and "Motor 7" in report.to_markdown() and "Motor 7" in report.to_json()
    assert "Profile" in str(report) or "profile" in str(report)
    assert {severity for severity, _ in report.reasons} <= {"usable"} and "<iframe" in report._repr_html_()
    for name in ["r.md", "r.json", "r.txt"]:
        report.save(tmp_path / name)
        assert (tmp_path / name).stat().st_size > 1000
    with pytest.raises(gb.Error, match="one of these endings"):
        fitted.report(tmp_path / "r.pdf")
    with pytest.raises(gb.Error, match="No such file"):
        fitted.report(tmp_path / "nowhere" / "r.html")
    wrong: list[tuple[dict[str, Any], str]] = [
        ({"profiles": "rs"}, "profiles is 'rs'; give names in a list"),
        ({"profiles": 3}, "profiles is 3; give names in a list"),
        ({"bootstrap": 0.9}, r"bootstrap is 0\.9; give what fit\.bootstrap\(\) returns"),
        ({"path": 7}, "path is 7; give the path of a file"),
    ]
    for given, said in wrong:
        with pytest.raises(gb.Error, match=said):
            fitted.report(**given)
    for ask in (report.save, gb.read, gb.load):
        with pytest.raises(gb.Error, match="path is 7; give the path of a file"):
            ask(7)  # type: ignore[operator]
    assert sorted(one.name for one in tmp_path.iterdir()) == ["r.html", "r.json", "r.md", "r.txt"]


def test_notebooks_show_verdict_table_and_picture(fitted: gb.Fit) -> None:
    shown = fitted._repr_html_()
    assert "<b>Verdict: usable.</b>" in shown and "<td>rs</td><td>0.630317</td><td>ohm</td>" in shown and "<svg" in shown


def test_profiles(fitted: gb.Fit) -> None:
    profile = fitted.profile("rs")
    lower, upper = fitted.interval("rs")
    # The motor is nearly linear in its parameters: both intervals agree to a few percent of their width.
    assert profile.lower == pytest.approx(lower, abs=0.05 * (upper - lower))
    assert profile.upper == pytest.approx(upper, abs=0.05 * (upper - lower))
    table = profile.table()
    assert isinstance(table, pd.DataFrame) and table["rise"].min() == pytest.approx(0.0, abs=1e-9)
    assert repr(profile).startswith("rs is within 0.62")
    with pytest.raises(gb.Error, match="there is no unknown `r`"):
        fitted.profile("r")
    for ask in (lambda: fitted.profile("rs", "0.9"), lambda: fitted.interval("rs", "0.9"), lambda: fitted.bands("0.9")):  # type: ignore[arg-type]
        with pytest.raises(gb.Error, match="probability is '0.9'; give a number"):
            ask()
    for ask in (lambda: fitted.profile("rs", float("nan")), lambda: fitted.interval("rs", 1.5), lambda: fitted.bands(0.0)):
        with pytest.raises(gb.Error, match="probability"):
            ask()
    for ask in (lambda: fitted.profile(np.zeros(2)), lambda: fitted.interval(np.zeros(2))):  # type: ignore[arg-type]
        with pytest.raises(gb.Error, match=r"name is array\(\[0., 0.\]\); give its name as text"):
            ask()
    with pytest.raises(gb.Error, match="title is 3; give its name as text"):
        fitted.report(title=3)  # type: ignore[arg-type]


def test_columns_of_one_name_are_not_lost() -> None:
    def renamed(room: str, body: str) -> gb.Fit:
        model = gb.model(lambda t, x, u, p: [p.k * (u[0] - x[0])], states=[body], inputs=[room], outputs=[body], parameters=["k"])
        c = cooled()
        return gb.fit(model, {"time": c["t"], room: c["room"], body: c["body"]}, k=gb.free(1.0))

    for room, body, name in [("body_predicted", "body", "body_predicted"), ("body_residual", "body", "body_residual"), ("room", "t", "t")]:
        with pytest.raises(gb.Error, match=f"the table would have two columns `{name}` of other values; rename the signal of the model"):
            renamed(room, body).to_dataframe()
    with pytest.raises(gb.Error, match="two columns `t`"):
        renamed("room", "t").predict()
    # What is an input and an output is one column.
    c = cooled()
    both = gb.model(
        lambda t, x, u, p: [p.k * (u.room - x.body)], output=lambda t, x, u, p: [x.body, u.room], states=["body"], inputs=["room"],
        outputs=["body", "room"], parameters=["k"],
    )
    made = gb.simulate(both, {"t": c["t"], "room": c["room"]}, parameters={"k": 0.3})
    assert list(made) == ["t", "room", "body"] and (made["room"] == c["room"]).all()
    with pytest.raises(gb.Error, match="two columns `room`"):
        gb.simulate(both, {"t": c["t"], "room": c["room"]}, parameters={"k": 0.3}, noise={"room": 0.1})


def test_single_residuals_of_colored_errors_are_warned_of() -> None:
    record = cooled()
    noise = np.random.default_rng(2).normal(0.0, 1.0, 200)
    for i in range(1, 200):
        noise[i] += 0.9 * noise[i - 1]
    with pytest.warns(gb.FitWarning, match="are not white"):
        fit = gb.fit(cooling(), {**record, "body": record["body"] + 0.2 * noise}, k=gb.free(1.0))
    with pytest.warns(gb.FitWarning, match=r"\[colored_errors\].*single residuals"):
        assert fit.bootstrap(20).colored
    assert not fit.bootstrap(20, blocks=0).colored


def test_bootstrap(fitted: gb.Fit, tmp_path: Path) -> None:
    drawn = fitted.bootstrap(200, seed=3)
    assert drawn.unknowns == fitted.unknowns and drawn.converged == drawn.tried == 200 and not drawn.colored
    for name in ("rs", "ls", "ke"):
        # The standard deviation of 200 draws is known to 5 %; four times that.
        assert drawn.standard_error(name) == pytest.approx(fitted.standard_errors[name], rel=0.2)
        lower, upper = drawn.interval(name)
        assert lower < fitted.parameters[name] < upper
    table = drawn.table()
    assert isinstance(table, pd.DataFrame) and table["upper"][0] == drawn.interval("rs")[1]
    assert fitted.bootstrap(200, seed=3).to_json() == drawn.to_json() != fitted.bootstrap(200, seed=4).to_json()
    assert repr(drawn).startswith("200 of 200 refits ended; seed 3\nrs ")
    report = fitted.report(tmp_path / "r.html", bootstrap=drawn)
    assert "200 of 200 refits ended" in str(report) and "Bootstrap" in (tmp_path / "r.html").read_text()
    for said, says in [({"count": 0}, "count is 0"), ({"blocks": -1}, "blocks is -1"), ({"count": 10}, "twenty are the least"),
                       ({"blocks": 3000}, "block"), ({"count": 2**70}, "count is 1180591620717411303424; take a whole number of 1000000000 or"),
                       ({"count": "200"}, "count is '200'"), ({"blocks": 1.5}, "blocks is 1.5"), ({"seed": -1}, "seed is -1"),
                       ({"seed": 2**64}, "seed is 18446744073709551616")]:  # fmt: skip
        with pytest.raises(gb.Error, match=says):
            fitted.bootstrap(**said)
    with pytest.raises(gb.Error, match="there is no unknown `r`"):
        drawn.interval("r")


def test_a_time_limit_keeps_the_refits_so_far() -> None:
    found = gb.fit(cooling(), cooled(), k=gb.free(1.0), time_limit=5.0)
    with pytest.warns(gb.FitWarning, match="of 10000000 refits") as caught:
        drawn = found.bootstrap(10_000_000)
    assert 20 <= drawn.converged <= drawn.tried < 10_000_000
    assert f"after {drawn.tried} of" in str(caught[0].message)


def test_bands(fitted: gb.Fit) -> None:
    bands = fitted.bands(0.95)
    assert list(bands.columns) == ["t", "id_confidence", "iq_confidence", "id_prediction", "iq_prediction"]
    # A new measurement is within 1.96 standard deviations of noise and model together; the noise is 0.05 A.
    assert bands["id_prediction"].mean() == pytest.approx(1.96 * 0.0503, rel=0.01)
    assert (bands["id_confidence"] < 0.3 * bands["id_prediction"]).mean() > 0.95
    residuals = fitted.residuals()
    inside = (residuals["id"].abs() < bands["id_prediction"]).mean()
    # Of 2,000 samples, 95 % within three binomial standard deviations.
    assert inside == pytest.approx(0.95, abs=3 * (0.95 * 0.05 / 2000) ** 0.5)


def test_plots(fitted: gb.Fit, tmp_path: Path) -> None:
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    for name, figure in {"a": fitted.plot(), "b": fitted.plot_residuals(), "c": fitted.profile("ke").plot()}.items():
        figure.savefig(tmp_path / f"{name}.png")
        assert (tmp_path / f"{name}.png").stat().st_size > 5000
    assert [axis.get_ylabel() for axis in fitted.plot().axes] == ["id (A)", "iq (A)", "ud (V)", "uq (V)", "w (rad/s)"]
    two = gb.fit(cooling(), [gb.Record(cooled(), name="a"), gb.Record(cooled(seed=2), name="b")], k=gb.free(1.0))
    assert len(two.plot().axes[0].lines) == 4


def test_levels_that_move() -> None:
    """A column of deviations weights the samples: the weighted least squares in closed form."""
    rng = np.random.default_rng(4)
    u = np.arange(1.0, 121.0)
    deviation = np.where(np.arange(120) % 4 == 0, 0.1, 5.0)
    frame = pd.DataFrame({"t": u, "u": u, "s": deviation, "y": 3.0 * u + deviation * rng.normal(size=120)})
    model = gb.model(
        output=lambda t, x, u, p: [p.a * u.u], noise=lambda t, x, u, p: [u.s], inputs=["u", "s"], outputs=["y"], parameters=["a"],
    )
    found = gb.fit(model, frame, parameters={"a": gb.free(1.0)}, time="t", predictor="kalman")
    weights = u / deviation**2
    assert found.parameters.a == pytest.approx((weights * frame["y"]).sum() / (weights * u).sum(), rel=1e-12)
    assert found.standard_errors.a == pytest.approx((weights * u).sum() ** -0.5, rel=1e-6)


def test_initial_functions() -> None:
    """The state at rest, and one that the model says, are no unknowns; records share what is unknown of the latter."""
    u = np.where(np.arange(200) < 20, 2.0, -1.0)
    frame = pd.DataFrame({"t": 0.1 * np.arange(200.0), "u": u})
    parts = {"states": ["x"], "inputs": ["u"], "outputs": ["x"]}
    plain = gb.model(lambda t, x, u, p: [u.u - p.a * x.x], **parts, parameters=["a"])
    record = gb.simulate(plain, frame, parameters={"a": 0.5}, initial={"x": 4.0}, time="t")
    rest = gb.fit(plain, record, a=gb.free(0.8), time="t", initial="steady")
    assert rest.table()["name"].tolist() == ["a"] and rest.parameters.a == pytest.approx(0.5, rel=1e-6)
    says = gb.model(lambda t, x, u, p: [u.u - p.a * x.x], initial=lambda u, p: [p.x0 + 0 * u.u], **parts, parameters=["a", "x0"])
    made = gb.simulate(says, frame, parameters={"a": 0.5, "x0": 4.0}, time="t")
    assert np.abs(made["x"] - record["x"]).max() < 1e-12
    other = gb.simulate(plain, frame.assign(u=0.5 * u), parameters={"a": 0.5}, initial={"x": 4.0}, time="t")
    both = gb.fit(says, [record, other], a=gb.free(0.8), x0=gb.free(1.0), time="t")
    assert both.parameters.x0 == pytest.approx(4.0, rel=1e-6) and len(both.table()) == 2
    with pytest.raises(gb.Error, match=r"\(u, p\)"):
        gb.model(lambda t, x, u, p: [u.u], initial=lambda p: [p.x0], **parts, parameters=["x0"]).equations()
