"""Files, each written by another program, and signals with rates of their own."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import polars as pl
import pyarrow as pa
import pytest
from conftest import DATA, Pmsm, cooled, cooling
from pyarrow import feather

import greybox as gb


def k_of(data: Any, **said: Any) -> float:
    return float(gb.fit(cooling(), data, k=gb.free(1.0), **said).parameters.k)


def matlab(path: Path, record: dict[str, Any]) -> None:
    io = pytest.importorskip("scipy.io")
    io.savemat(path, {name: column[:, None] for name, column in record.items()} | {"comment": "a test", "n": 3.0})


def structure(path: Path, record: dict[str, Any]) -> None:
    io = pytest.importorskip("scipy.io")
    io.savemat(path, {"log": {**record, "comment": "a test"}, "n": 3.0}, do_compression=True)


def matlab_hdf5(path: Path, record: dict[str, Any]) -> None:
    """As MATLAB writes version 7.3: a block of 512 bytes before, columns as rows, classes as attributes."""
    h5py = pytest.importorskip("h5py")
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, column in record.items():
            file[name] = column[None, :]
            file[name].attrs["MATLAB_class"] = np.bytes_(b"double")
        file["comment"] = np.frombuffer("text".encode("utf-16-le"), np.uint16)[:, None]
        file["comment"].attrs["MATLAB_class"] = np.bytes_(b"char")
    with path.open("r+b") as raw:
        raw.write(b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM")


def log(path: Path, record: dict[str, Any]) -> None:
    asammdf = pytest.importorskip("asammdf")
    with asammdf.MDF(version="4.10") as file:
        file.append([asammdf.Signal(record[name], record["t"], name=name) for name in ("room", "body")])
        file.save(path, overwrite=True)


FILES: dict[str, Callable[[Path, dict[str, Any]], Any]] = {
    "csv": lambda path, c: pd.DataFrame(c).to_csv(path, index=False),
    "parquet": lambda path, c: pd.DataFrame(c).to_parquet(path),
    "pq": lambda path, c: pl.DataFrame(c).write_parquet(path),
    "arrow": lambda path, c: pl.DataFrame(c).write_ipc(path),
    "ipc": lambda path, c: feather.write_feather(pa.table(c), path, compression="uncompressed"),
    "feather": lambda path, c: pd.DataFrame(c).to_feather(path),
    "npz": lambda path, c: np.savez_compressed(path, **c),
    "npy": lambda path, c: np.save(path, np.rec.fromarrays(list(c.values()), names=list(c))),
    "mat": matlab,
    "MAT": structure,
    "73.mat": matlab_hdf5,
    "mf4": log,
}


@pytest.mark.parametrize("kind", FILES)
def test_a_file_has_the_bits_of_its_numbers(kind: str, tmp_path: Path) -> None:
    path = tmp_path / f"record.{kind}"
    FILES[kind](path, cooled())
    found = gb.fit(cooling(), path, k=gb.free(1.0))
    assert found.parameters.k == k_of(cooled())
    assert found.to_dataframe(str(path))["body_residual"].shape == (200,)
    if kind != "csv":
        few = gb.read(path, signals=["body"])
        assert "room" not in (few.column_names if isinstance(few, pa.Table) else few)
        with pytest.raises(gb.Error, match="there is no signal `Body`; the file has: .*body"):
            gb.read(path, signals=["Body"])


@pytest.mark.parametrize("kind", ["parquet", "arrow"])
def test_an_index_of_pandas_without_a_name_is_the_time(kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    c = cooled()
    frame = pd.DataFrame({"room": c["room"], "body": c["body"]}, index=pd.Timestamp("2025-03-20") + pd.to_timedelta(c["t"], unit="s"))
    path = tmp_path / f"record.{kind}"

    def written(frame: pd.DataFrame) -> Path:
        frame.to_parquet(path) if kind == "parquet" else feather.write_feather(pa.Table.from_pandas(frame), path, compression="uncompressed")
        return path

    assert k_of(written(frame)) == k_of(frame)
    assert k_of(pl.from_arrow(pa.Table.from_pandas(frame))) == k_of(frame)
    assert k_of(written(frame.set_axis(c["t"]))) == k_of(c)
    rows = gb.fleet(cooling(), pa.Table.from_pandas(frame.assign(which="a")), by="which", k=gb.free(1.0))
    assert rows["k"][0].as_py() == pytest.approx(k_of(frame), rel=1e-9)
    # What is left of the numbers of rows is no time, and no text is; a sample time does without them.
    for index in (np.arange(200) + 5, [f"row {k}" for k in range(200)]):
        assert k_of(written(frame.set_axis(index)), sample_time=0.1) == k_of(c)
        with pytest.raises(gb.Error, match="no column `t` or `time`|neither a number"):
            k_of(path)


def test_several_files_and_what_is_said_of_each(tmp_path: Path) -> None:
    for name, k in {"cold": 0.3, "warm": 0.5}.items():
        pd.DataFrame(cooled(k=k)).rename(columns={"t": "when", "body": "T"}).to_csv(tmp_path / f"{name}.csv", index=False, sep=";", decimal=",")
    paths = [tmp_path / "cold.csv", tmp_path / "warm.csv"]
    found = gb.fit(cooling(), paths, k=gb.free(1.0, per_experiment=True), time="when", columns={"body": "T"})
    assert [one["name"] for one in found.to_dict()["experiments"]] == ["cold", "warm"]
    assert found.parameters.k == pytest.approx(0.3, rel=0.01)
    with pytest.raises(gb.Error, match="no column `body`; the file has: when, room, T; name another with columns="):
        gb.fit(cooling(), paths[0], k=gb.free(1.0), time="when")
    with pytest.raises(gb.Error, match="read by pandas: gb.fleet"):
        gb.fleet(cooling(), paths[0], by="which", k=gb.free(1.0))


@pytest.mark.parametrize("kind", ["csv", "parquet"])
def test_files_of_one_name_in_two_folders_are_two_records(kind: str, tmp_path: Path) -> None:
    paths = [tmp_path / folder / f"run.{kind}" for folder in ("cold", "warm")]
    for path, k in zip(paths, (0.3, 0.5), strict=True):
        path.parent.mkdir()
        FILES[kind](path, cooled(k=k))
    found = gb.fit(cooling(), paths, k=gb.free(1.0, per_experiment=True))
    names = ["run #1", "run #2"]
    assert [name for name in found.unknowns if name.startswith("k")] == [f"k [{name}]" for name in names]
    of = pd.DataFrame(found.to_dataframe())["record"]
    assert of.value_counts(sort=False).to_dict() == dict.fromkeys(names, 200)


def test_another_file_of_a_record_s_name_is_said_to_take_its_parameters(tmp_path: Path) -> None:
    paths = [tmp_path / "cold.csv", tmp_path / "warm.csv"]
    for path, k in zip(paths, (0.3, 0.5), strict=True):
        pd.DataFrame(cooled(k=k)).to_csv(path, index=False)
    found = gb.fit(cooling(), paths, k=gb.free(1.0, per_experiment=True))
    (tmp_path / "later").mkdir()
    other = tmp_path / "later" / "warm.csv"
    other.write_bytes(paths[1].read_bytes())
    with warnings.catch_warnings():
        warnings.simplefilter("error", gb.RecordWarning)
        same = found.predict(paths[1])["body"]
        named = found.predict(gb.Record(other, name="warm"))["body"]
    with pytest.warns(gb.RecordWarning, match="takes the own parameters of its record `warm`"):
        unsaid = found.predict(other)["body"]
    assert (same == named).all() and (same == unsaid).all()


def test_a_unit_that_is_not_the_signals_is_refused_with_the_factor(tmp_path: Path, declared: dict[str, gb.Parameter]) -> None:
    frame = pd.read_csv(DATA / "pmsm.csv")
    text = frame.to_csv(index=False).splitlines()
    units = {"t": "s", "ud": "V", "uq": "V", "w": "rpm", "id": "A", "iq": "A"}
    (tmp_path / "a.csv").write_text("\n".join([text[0], ",".join(units[name] for name in frame.columns), *text[1:]]))
    with pytest.raises(gb.Error, match="give a frame in which `w` is multiplied by 0.1047.*, or by 1 if the file's unit is wrong"):
        gb.fit(Pmsm(4), tmp_path / "a.csv", **declared)


def test_the_librarys_record_needs_no_frame(declared: dict[str, gb.Parameter], fitted: gb.Fit) -> None:
    found = gb.fit(Pmsm(4), DATA / "pmsm.csv", **declared)
    # Times of the file are stamps there and in pandas; both are read to the last bit.
    assert list(found.parameters.values()) == list(fitted.parameters.values())


def test_a_file_of_matlab_itself() -> None:
    scipy = pytest.importorskip("scipy")
    data = Path(scipy.__file__).parent / "io" / "matlab" / "tests" / "data"
    if not data.is_dir():
        pytest.skip("this SciPy has no files of MATLAB")
    # Written by MATLAB 7.4: the numbers from 0 to 2 pi in steps of pi / 4.
    for name in ["testhdf5_7.4_GLNX86.mat", "testdouble_7.4_GLNX86.mat"]:
        expected = np.arange(9) * np.pi / 4
        assert np.allclose(gb.read(data / name)["testdouble"], expected, rtol=1e-15)


def test_columns_of_a_matrix_and_fields_beside_vectors(tmp_path: Path) -> None:
    io = pytest.importorskip("scipy.io")
    c = cooled()
    io.savemat(tmp_path / "m.mat", {"t": c["t"], "T": np.stack([c["room"], c["body"]], axis=1), "log": {"w": c["t"]}})
    found = gb.read(tmp_path / "m.mat")
    assert list(found) == ["t", "T_1", "T_2", "log.w"] and found["T_2"].tolist() == c["body"].tolist()
    io.savemat(tmp_path / "s.mat", {"comment": "no numbers"})
    with pytest.raises(gb.Error, match="no vectors of numbers in the file, but comment .*table2struct"):
        gb.read(tmp_path / "s.mat")


@pytest.mark.parametrize("kind", [kind for kind in FILES if kind != "csv"])
def test_bad_files_are_errors(kind: str, tmp_path: Path) -> None:
    path = tmp_path / f"record.{kind}"
    with pytest.raises(gb.Error, match="there is no such file"):
        gb.read(path)
    FILES[kind](path, cooled())
    whole = path.read_bytes()
    for spoiled, says in [(b"", "the file is empty"), (b"no file of this kind " * 40, "cannot be read"), (whole[: len(whole) // 2], "record")]:
        path.write_bytes(spoiled)
        with pytest.raises(gb.Error, match=says), warnings.catch_warnings():
            # asammdf leaves half of an object behind.
            warnings.simplefilter("ignore")
            gb.fit(cooling(), path, k=gb.free(1.0))


def test_other_files_are_errors(tmp_path: Path) -> None:
    for name, says in {"a.xlsx": "files that end in `.xlsx` are not known; known are .parquet", "a.csv": "hand the path over"}.items():
        with pytest.raises(gb.Error, match=says):
            gb.read(tmp_path / name)
    with pytest.raises(gb.Error, match="nowhere.csv"):
        gb.fit(cooling(), tmp_path / "nowhere.csv", k=gb.free(1.0))
    np.save(tmp_path / "a.npy", np.zeros((5, 2)))
    with pytest.raises(gb.Error, match="has no names; make a frame"):
        gb.read(tmp_path / "a.npy")
    with pytest.raises(gb.Error, match="see gb.align"):
        gb.read(tmp_path / "a.npy", step=0.1)


def test_a_package_that_is_absent_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import sys

    (tmp_path / "a.mf4").write_bytes(b"MDF")
    monkeypatch.setitem(sys.modules, "asammdf", None)
    with pytest.raises(gb.Error, match="pip install asammdf"):
        gb.read(tmp_path / "a.mf4")


FAST = np.arange(0, 1001) * 0.001
SLOW = np.arange(0, 11) * 0.1


def test_methods_of_alignment() -> None:
    signals = {"fast": (FAST, FAST**2), "slow": (SLOW, 10 * SLOW)}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", gb.RecordWarning)
        last, linear = gb.align(signals), gb.align(signals, method="linear")
        thin = gb.align(signals, method={"fast": "mean"}, step=0.1)
    assert last["t"].tolist() == FAST.tolist() and last["fast"].tolist() == (FAST**2).tolist()
    assert last["slow"][:100].tolist() == [0.0] * 100 and last["slow"][100] == 1.0 and last["slow"][-1] == 10.0
    assert np.allclose(linear["slow"], 10 * FAST, rtol=1e-14)
    # The mean of x^2 over 101 samples around x, the halves of ties to one side: x^2 + h^2 (n^2 - 1) / 12 of n = 100, shifted by half a sample.
    assert thin["fast"][5] == pytest.approx(0.25 + 0.001**2 * (100**2 - 1) / 12, abs=0.001)
    own = gb.align(signals, method={"slow": "own"})
    assert np.flatnonzero(np.isfinite(own["slow"])).tolist() == list(range(0, 1001, 100)) and own["slow"][500] == 5.0


def test_masks_are_missing_values() -> None:
    masked = np.ma.array([1, 2, 3], mask=[0, 1, 0])
    assert np.isnan(gb.align({"a": ([0.0, 1.0, 2.0], masked)}, method="own")["a"]).tolist() == [False, True, False]


def test_alignment_warns_where_the_method_matters() -> None:
    signals = {"fast": (FAST, FAST), "slow": (SLOW, SLOW)}
    with pytest.warns(gb.RecordWarning, match="`slow` is sampled each 0.1 s and filled in each 0.001 s .last, late by 0.05 s") as caught:
        gb.align(signals)
    assert len(caught) == 1 and caught[0].filename == __file__
    with pytest.warns(gb.RecordWarning, match="`fast` is sampled each 0.001 s, and each 0.1 s one of its samples"):
        gb.align(signals, step=0.1)
    with pytest.warns(gb.RecordWarning, match="samples of `slow` are moved by up to 0.0004 s"):
        gb.align({**signals, "slow": (SLOW + 0.0004, SLOW)}, method={"slow": "own"})
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        gb.align(signals, method={"slow": "own"})
        gb.align(signals, method={"fast": "mean"}, step=0.1)


WRONG: list[tuple[dict[str, Any], dict[str, Any], str]] = [
    ({}, {}, "no signals to align"),
    ({"a": ([0.0, 1.0], [1.0])}, {}, "every value needs a time"),
    ({"a": ([0.0, 0.0], [1.0, 2.0])}, {}, "the time does not increase at sample 1"),
    ({"a": ([0.0, np.nan], [1.0, 2.0])}, {}, "a time that is no number at sample 1"),
    ({"a": ([], np.zeros(0))}, {}, "has no samples"),
    ({"a": ([0.0], ["x"])}, {}, "in place of numbers"),
    ({"a": (np.array(["2025-03-20"], dtype="datetime64[ns]"), [1.0])}, {}, "has dates as times"),
    ({"a": ([0.0, 1.0], [1.0, 2.0]), "b": ([2.0, 3.0], [1.0, 2.0])}, {}, "`a` ends at 1 s, and `b` begins at 2 s"),
    ({"a": ([0.0, 1.0], [1.0, 2.0])}, {"step": 0.0}, "the step is 0.0"),
    ({"a": ([0.0, 1.0], [1.0, 2.0])}, {"step": "0.1"}, "step is '0.1'; give a number"),
    ({"a": [0.0, 1.0, 2.0]}, {}, "signal `a` is [0.0, 1.0, 2.0]; give its times and its values: (times, values)"),
    ({"a": ([0.0, 1.0], [1.0, 2.0])}, {"method": "cubic"}, "method of `a` is 'cubic'"),
    ({"a": ([0.0, 1.0], [1.0, 2.0])}, {"method": {"b": "last"}}, "method names `b`"),
]


@pytest.mark.parametrize("signals, said, says", WRONG)
def test_what_cannot_be_aligned_is_named(signals: dict[str, Any], said: dict[str, Any], says: str) -> None:
    with pytest.raises(gb.Error) as raised:
        gb.align(signals, **said)
    assert says in str(raised.value), raised.value


def test_a_log_with_two_rates_gives_the_slow_output_once(tmp_path: Path) -> None:
    asammdf = pytest.importorskip("asammdf")
    c = cooled(2000)
    with asammdf.MDF(version="4.10") as file:
        file.append([asammdf.Signal(c["room"], c["t"], name="room")])
        file.append([asammdf.Signal(c["body"][::10], c["t"][::10], name="body")])
        file.append([asammdf.Signal(np.array([b"on", b"off"]), np.array([0.0, 1.0]), name="state", encoding="utf-8")])
        file.save(tmp_path / "a.mf4", overwrite=True)
    once = gb.read(tmp_path / "a.mf4", method={"body": "own"})
    assert list(once) == ["t", "room", "body"]
    found = gb.fit(cooling(), once, k=gb.free(1.0))
    sparse = {**c, "body": np.where(np.arange(2000) % 10 == 0, c["body"], np.nan)}
    assert found.parameters.k == k_of(sparse) and found.to_dict()["measurements"] == 200
    with pytest.warns(gb.RecordWarning):
        filled = gb.read(tmp_path / "a.mf4")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", gb.FitWarning)
        counted = gb.fit(cooling(), filled, k=gb.free(1.0))
    # Held measurements are late by half of their spacing, and their errors are no noise. The last of them is at 199.0 s.
    assert counted.verdict == "not usable" and counted.to_dict()["measurements"] == 1991
