"""Models from files."""

from __future__ import annotations

import json
import os
import pickle
import subprocess
import warnings
from pathlib import Path
from typing import Any

import pandas as pd
import pytest
from conftest import DATA

import greybox as gb

PMSM = """
greybox = 1
name = "PMSM with surface magnets"
[constants]
np = { value = 3, unit = "1" }
[inputs]
ud = "V"
uq = "V"
w = "rad/s"
[parameters]
rs = { unit = "ohm", start = 1.0, within = [0.01, 10] }
ls = { unit = "H", start = 2e-3 }
ke = { unit = "V s/rad", start = 0.7 }
[let]
we = "w*np"
[states]
id = { unit = "A", derivative = "(ud - rs*id)/ls + we*iq" }
iq = { unit = "A", derivative = "(uq - rs*iq - ke*w*sqrt(2/3))/ls - we*id" }
[outputs]
id = "id"
iq = "iq"
"""


@pytest.fixture
def path(tmp_path: Path) -> Path:
    path = tmp_path / "pmsm.toml"
    path.write_text(PMSM)
    return path


def test_a_file_is_fitted_as_it_declares(path: Path, motor: pd.DataFrame, declared: dict[str, gb.Parameter], fitted: gb.Fit) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", gb.ModelWarning)
        model = gb.load(path, np=4)
    assert model.declared == declared
    found = gb.fit(model, motor)
    # One graph in another order of its nodes: equal to ten digits, where the search stops at 1e-10.
    assert found.parameters.rs == pytest.approx(fitted.parameters.rs, rel=1e-9)
    assert found.standard_errors.ke == pytest.approx(fitted.standard_errors.ke, rel=1e-6)
    again = pickle.loads(pickle.dumps(model))
    assert again == model and again.declared == model.declared
    held = gb.fit(model, motor, ke=gb.fixed(0.95))
    assert held.parameters.ke == 0.95
    rows = gb.fleet(model, motor.assign(motor=1), by="motor")
    assert rows["rs"][0] == pytest.approx(fitted.parameters.rs, rel=1e-9)


def test_a_fit_has_the_bits_of_the_command_in_rust(path: Path, tmp_path: Path) -> None:
    command = os.environ.get("GREYBOX_COMMAND", "")
    if not os.access(command, os.X_OK):
        pytest.skip("the command greybox was not built: cargo build -p greybox-cli, and its path as GREYBOX_COMMAND")
    path.write_text(PMSM.replace("value = 3", "value = 4"))
    stored = tmp_path / "estimate.json"
    subprocess.run([command, "fit", path, DATA / "pmsm.csv", "--json", stored], check=True, capture_output=True)
    rust = json.loads(stored.read_text())
    for data in (DATA / "pmsm.csv", pd.read_csv(DATA / "pmsm.csv")):
        found = gb.fit(gb.load(path), gb.Record(data, name=rust["experiments"][0]["name"])).to_dict()
        assert found.pop("seconds") > 0
        assert found == {name: value for name, value in rust.items() if name != "seconds"}


def test_a_file_says_noise_holds_and_initial_states(path: Path, motor: pd.DataFrame) -> None:
    text = PMSM.replace('iq = "iq"', 'iq = { value = "iq", unit = "A", noise = 0.05 }').replace(
        'id = "id"', 'id = { value = "id", unit = "A", noise = 0.05 }'
    )
    text = text.replace('ud = "V"', 'ud = { unit = "V", hold = "zero" }').replace('we*iq" }', 'we*iq", initial = "first" }')
    path.write_text(text.replace('we*id" }', 'we*id", initial = "first" }'))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        found = gb.fit(gb.load(path, np=4), motor)
        estimated = gb.fit(gb.load(path, np=4), motor, initial="estimated")
    assert found.to_dict()["method"]["noise"] == "given" and found.unknowns == ["rs", "ls", "ke"]
    assert estimated.unknowns == ["rs", "ls", "ke", "id(0)", "iq(0)"]


def test_noise_of_some_outputs_in_a_file(path: Path, motor: pd.DataFrame) -> None:
    path.write_text(PMSM.replace('id = "id"', 'id = { value = "id", unit = "A", noise = 0.1 }').replace("value = 3", "value = 4"))

    def sigmas(**said: Any) -> list[float]:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return [one["fit"]["sigma"] for one in gb.fit(gb.load(path), motor, **said).to_dict()["outputs"]]

    given, estimated = sigmas()
    assert given == 0.1 and estimated == pytest.approx(0.05, rel=0.05)
    # What is said of one output leaves that of the other as the file has it.
    assert sigmas(noise={"iq": 0.2}) == [0.1, 0.2]
    assert sigmas(noise={"id": 0.2})[0] == 0.2


def test_mistakes_have_their_place(path: Path) -> None:
    path.write_text(PMSM.replace("ud - rs*id", "ud - rz*id"))
    with pytest.raises(gb.Error) as raised:
        gb.load(path)
    assert "rz" in str(raised.value) and "pmsm.toml" in str(raised.value)
    with pytest.raises(gb.Error, match="nowhere.toml"):
        gb.load(path.with_name("nowhere.toml"))
    path.write_text(PMSM)
    with pytest.raises(gb.Error, match="npp"):
        gb.load(path, npp=4)


def test_units_that_do_not_fit_are_warned_of(path: Path) -> None:
    path.write_text(PMSM.replace("ud - rs*id", "ud - rs*w"))
    with pytest.warns(gb.ModelWarning, match="ud"):
        gb.load(path)
