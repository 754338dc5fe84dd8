"""Frames: every kind gives the same numbers, times of every kind, and what is wrong is named."""

from __future__ import annotations

import datetime
import re
import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
import pandas as pd
import polars as pl
import pyarrow as pa
import pytest
from conftest import cooled, cooling

import greybox as gb
from greybox.frames import Frame, is_readonly


def k_of(data: Any, **said: Any) -> float:
    return float(gb.fit(cooling(), data, k=gb.free(1.0), **said).parameters.k)


class Stream:
    """Any object that hands over an Arrow stream."""

    def __init__(self, table: pa.Table) -> None:
        self.table = table

    def __arrow_c_stream__(self, requested_schema: Any = None) -> Any:
        return self.table.__arrow_c_stream__(requested_schema)


def structured(columns: dict[str, Any]) -> Any:
    array = np.zeros(len(columns["t"]), dtype=[(name, float) for name in columns])
    for name, column in columns.items():
        array[name] = column
    return array


KINDS: dict[str, tuple[Callable[[Any], Any], type]] = {
    "dict": (dict, dict),
    "lists": (lambda c: {name: column.tolist() for name, column in c.items()}, dict),
    "structured": (structured, dict),
    "pandas": (pd.DataFrame, pd.DataFrame),
    "pandas with nullable numbers": (lambda c: pd.DataFrame(c).convert_dtypes(), pd.DataFrame),
    "pandas with an index": (lambda c: pd.DataFrame(c).set_index("t"), pd.DataFrame),
    "polars": (pl.DataFrame, pl.DataFrame),
    "polars, lazy": (pl.LazyFrame, pl.DataFrame),
    "pyarrow": (pa.table, pa.Table),
    "a stream of Arrow": (lambda c: Stream(pa.table(c)), pa.Table),
}


@pytest.mark.parametrize("kind", KINDS)
def test_all_kinds_of_frames_give_the_same_bits_and_their_own_kind_back(kind: str) -> None:
    make, result = KINDS[kind]
    found = gb.fit(cooling(), make(cooled()), k=gb.free(1.0))
    assert found.parameters.k == k_of(cooled())
    assert isinstance(found.table(), result)
    assert isinstance(found.predict(), result)
    predicted = np.asarray(found.predict()["body"])
    # Noise of 0.05, of which 200 samples stay within five standard deviations.
    assert np.abs(predicted - cooled()["body"]).max() < 0.25


def test_xarray() -> None:
    xarray = pytest.importorskip("xarray")
    c = cooled()
    data = xarray.Dataset({"room": ("t", c["room"]), "body": ("t", c["body"])}, coords={"t": c["t"]})
    assert k_of(data) == k_of(c)


START = pd.Timestamp("2025-03-20")
TIMES: dict[str, Callable[[pd.TimedeltaIndex], Any]] = {
    "dates": lambda d: START + d,
    "dates with a zone, across summer time": lambda d: (pd.Timestamp("2025-03-30 00:59:50", tz="UTC") + d).tz_convert("Europe/Berlin"),
    "dates across the end of summer time": lambda d: (pd.Timestamp("2025-10-26 00:59:50", tz="UTC") + d).tz_convert("Europe/Berlin"),
    "durations": lambda d: d,
}


@pytest.mark.parametrize("times", TIMES)
@pytest.mark.parametrize("place", ["column", "index", "polars", "arrow", "dict"])
def test_dates_are_seconds_since_the_first(times: str, place: str) -> None:
    c = cooled()
    stamps = TIMES[times](pd.to_timedelta(np.arange(200) * 100, unit="ms"))
    frame = pd.DataFrame({**c, "t": stamps})
    data: Any = {
        "column": lambda: frame,
        "index": lambda: frame.set_index("t"),
        "polars": lambda: pl.from_pandas(frame),
        "arrow": lambda: pa.Table.from_pandas(frame),
        "dict": lambda: {**c, "t": stamps},
    }[place]()
    # 0.1 is not a binary number: seconds of nanoseconds are rounded once more.
    assert k_of(data) == pytest.approx(k_of(c), rel=1e-12)


def test_time_by_name_and_by_rate() -> None:
    c = cooled()
    assert k_of({**c, "when": c["t"], "t": np.zeros(200)}, time="when") == k_of(c)
    assert k_of(pd.DataFrame({**c}).rename(columns={"t": "Time"})) == k_of(c)
    assert k_of({"room": c["room"], "body": c["body"]}, sample_time=0.1) == k_of(c)
    assert k_of({**c, "T_body": c["body"], "body": np.zeros(200)}, columns={"body": "T_body"}) == k_of(c)


def test_a_signal_called_t_is_not_the_time() -> None:
    c = cooled()
    model = gb.model(
        lambda t, x, u, p: [p.k * (u.room - x.t)], states={"t": "K"}, inputs={"room": "K"}, outputs={"t": "K"}, parameters={"k": "1/s"}
    )
    renamed = {"time": c["t"], "room": c["room"], "t": c["body"]}
    index = pd.DataFrame(renamed).set_index("time")
    for frame in (renamed, index):
        assert float(gb.fit(model, frame, k=gb.free(1.0)).parameters.k) == k_of(c)
    fleet = gb.fleet(model, {**renamed, "which": np.zeros(200)}, by="which", k=gb.free(1.0))
    assert fleet["k"][0] == k_of(c)


def test_a_sample_time_beside_a_column_of_another_time_is_refused() -> None:
    c = cooled()
    assert k_of(c, sample_time=0.1) == k_of(c)
    says = r"sample_time=0.2 and column `t`, where 0.1 s lie between samples, both give the time"
    with pytest.raises(gb.Error, match=says):
        k_of(c, sample_time=0.2)
    fleet = gb.fleet(cooling(), {**c, "which": np.zeros(200)}, by="which", sample_time=0.2, k=gb.free(1.0))
    assert re.search(says, fleet["reason"][0])


@pytest.mark.parametrize(
    ("name", "scale", "said"),
    [
        ("t [ms]", 1e3, None),
        ("time (us)", 1e6, None),
        ("t / min", 1 / 60, None),
        ("time_ms", 1e3, None),
        ("Zeit [h]", 1 / 3600, None),
        ("clock [ms]", 1e3, "clock"),
        ("clock [ms]", 1e3, "clock [ms]"),
        ("clock_ms", 1e3, "clock_ms"),
    ],
)
def test_a_time_is_in_the_unit_that_its_name_says(name: str, scale: float, said: str | None) -> None:
    c = cooled()
    frame = pd.DataFrame({name: c["t"] * scale, "room": c["room"], "body": c["body"]})
    assert abs(k_of(frame, time=said) / k_of(c) - 1) < 1e-12
    several = pd.concat([frame.assign(which=k) for k in "ab"])
    rows = gb.fleet(cooling(), several, by="which", k=gb.free(1.0), time=said)
    assert (abs(rows["k"] / k_of(c) - 1) < 1e-9).all()
    assert abs(k_of(frame.set_index(name), time=said) / k_of(c) - 1) < 1e-12


def test_numbers_since_1970_are_recognized() -> None:
    c = cooled()
    stamps = (1_742_480_000_000 + (c["t"] * 1e3).round()).astype(np.int64)
    with pytest.warns(gb.RecordWarning, match="`t` are taken as milliseconds since 1970 .*the first is 1742480000000.*say their unit"):
        assert abs(k_of({**c, "t": stamps}) / k_of(c) - 1) < 1e-9
    # As floats they would be multiples of 256.
    fine = {**c, "t [ns]": 1_742_480_000_000_000_123 + (c["t"] * 1e9).round().astype(np.int64)}
    del fine["t"]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert abs(k_of(fine) / k_of(c) - 1) < 1e-12
    # The clock of a computer that runs for an hour, in nanoseconds.
    frame = {"t [ns]": 3.6e12 + c["t"] * 1e9, "room": c["room"], "body": c["body"]}
    assert abs(k_of(frame) / k_of(c) - 1) < 1e-9


def test_columns_may_say_the_unit_of_their_signal() -> None:
    c = cooled()
    frame = {"t [s]": c["t"], "room [K]": c["room"], "body / K": c["body"]}
    assert k_of(frame) == k_of(c)
    assert k_of({"t": c["t"], "air [K]": c["room"], "body": c["body"]}, columns={"room": "air"}) == k_of(c)
    # An exact name comes first.
    assert k_of({**frame, "room": c["room"], "room [K]": c["room"] * 2}) == k_of(c)
    rows = gb.fleet(cooling(), {**frame, "which": np.zeros(200, int)}, by="which", k=gb.free(1.0))
    assert abs(rows["k"][0] / k_of(c) - 1) < 1e-9


REFUSED: list[tuple[dict[str, str], str]] = [
    ({"room": "room [mK]"}, "column `room [mK]` is in \"mK\" and signal `room` in \"K\"; give a frame in which `room` is multiplied by 0.001, or rename the column if its unit is wrong"),
    ({"room": "room [degC]"}, "column `room [degC]` is in \"degC\" and signal `room` in \"K\"; their zeros differ: give a frame in which `room` is converted from \"degC\", or rename the column if its unit is wrong"),
    ({"t": "t [samples]"}, "column `t [samples]` has times in `samples`, no unit of time that is known: give a frame with a column `t` of seconds"),
]


@pytest.mark.parametrize(("names", "says"), REFUSED)
def test_units_that_do_not_fit_are_refused(names: dict[str, str], says: str) -> None:
    frame = pd.DataFrame(cooled()).rename(columns=names)
    with pytest.raises(gb.Error, match=re.escape(says)) as error:
        k_of(frame)
    assert "DataFile" not in str(error.value)
    with pytest.raises(gb.Error, match=re.escape(says)):
        gb.fleet(cooling(), frame.assign(which=1), by="which", k=gb.free(1.0))


def test_letters_behind_an_underscore_are_a_unit_where_the_signal_has_one_of_another_size() -> None:
    c = cooled()
    said = {"room": "air_mean", "body": "body_K"}
    frame = {"t": c["t"], "air_mean": c["room"], "body_K": c["body"], "air_degC": c["room"]}
    assert k_of(frame, columns=said) == k_of(c)
    with pytest.raises(gb.Error, match="column `air_degC` is in \"degC\" and signal `room` in \"K\""):
        k_of(frame, columns={**said, "room": "air_degC"})


def test_names_of_columns_may_be_numbers() -> None:
    c = cooled()
    numbered = {0: c["t"], 1: c["room"], 2: c["body"], 3: np.repeat([5, 6], 100)}
    said: dict[str, Any] = {"time": 0, "columns": {"room": 1, "body": 2}}
    for frame in (numbered, pd.DataFrame(numbered)):
        assert k_of(frame, **said) == k_of(c)
        rows = gb.fleet(cooling(), frame, by=3, k=gb.free(1.0), **said)
        assert list(rows["3"]) == [5, 6] and list(rows["samples"]) == [100, 100]
    with pytest.raises(gb.Error, match="there is no column `room`; the frame has: 0, 1, 2, 3"):
        k_of(pd.DataFrame(numbered), time=0)
    with pytest.raises(gb.Error, match="the frame has two columns `1`, 1 and '1'; rename one"):
        k_of({**c, 1: c["t"], "1": c["t"]})


def test_missing_outputs_are_left_out() -> None:
    c = cooled()
    c["body"][50:60] = np.nan
    masked = {**c, "body": np.ma.masked_invalid(c["body"])}
    with_null = pl.DataFrame(c).with_columns(pl.col("body").fill_nan(None))
    assert k_of(c) == k_of(masked) == k_of(with_null) == k_of({**c, "body": [None if np.isnan(y) else y for y in c["body"]]})


WRONG: list[tuple[Callable[[dict[str, Any]], Any], str]] = [
    (lambda c: pd.DataFrame(c).rename(columns={"body": "Body"}), "there is no column `body`; the frame has: t, room, Body; did you mean `Body`?"),
    (lambda c: pd.DataFrame(c).drop(columns="room"), "there is no column `room`"),
    (lambda c: pd.DataFrame(c).drop(columns="t"), "there is no column `t` or `time`"),
    # What is left of the numbers of rows is no time; nor is a temperature.
    (lambda c: pd.DataFrame(c).drop(columns="t").iloc[5:].drop(index=9), "there is no column `t` or `time`"),
    (lambda c: {"room": c["room"], "body": c["body"], "T": c["t"]}, "there is no column `t` or `time`"),
    (lambda c: {**c, "t": c["t"].reshape(-1, 1)}, "has the shape (200, 1)"),
    (lambda c: pd.DataFrame(c).astype({"body": str}), "which is no number"),
    (lambda c: pl.DataFrame(c).cast({"body": pl.String}), "which is no number"),
    (lambda c: {**c, "body": [str(y) for y in c["body"]]}, "which is no number"),
    (lambda c: {**c, "body": c["body"] + 1j}, "which is no number"),
    (lambda c: {**c, "body": pd.to_datetime(c["body"])}, "which is no number"),
    (lambda c: {**c, "t": [str(t) for t in c["t"]]}, "neither a number (s) nor a date"),
    (lambda c: {**c, "t": c["t"][::-1]}, "time does not increase at sample 1"),
    (lambda c: {**c, "t": np.r_[0.0, c["t"][:-1]]}, "samples 0 and 1 are at one instant"),
    (lambda c: {**c, "t": START + pd.to_timedelta(np.r_[0, c["t"][:-1]], unit="s")}, "samples 0 and 1 are at one instant"),
    (lambda c: {**c, "t": [pd.NaT, *(START + pd.to_timedelta(c["t"][1:], unit="s"))]}, "neither a number (s) nor a date"),
    (lambda c: pd.DataFrame({**c, "t": [pd.NaT, *(START + pd.to_timedelta(c["t"][1:], unit="s"))]}), "rows without a time"),
    (lambda c: {**c, "room": np.where(c["t"] == c["t"][7], np.nan, c["room"])}, "only outputs may be missing"),
    (lambda c: {**c, "body": np.full(200, np.nan)}, "missing in every sample"),
    (lambda c: {**c, "body": c["body"][:100]}, "has 100 rows, and there are 200 times"),
    (lambda c: {**c, "body": c["body"].reshape(2, 100)}, "has the shape (2, 100)"),
    (lambda c: pd.DataFrame(c).iloc[:0], "2 or more are needed"),
    (lambda c: pd.DataFrame(c).iloc[:1], "2 or more are needed"),
    (lambda c: {**c, "body": [[1.0], [1.0, 2.0]]}, "column `body` is no array"),
    (lambda c: {**c, "t": [[1.0], [1.0, 2.0]]}, "column `t` is no array"),
    (lambda c: {**c, "body": [10**400, *c["body"][1:]]}, "which is no number"),
    (lambda c: 3.0, "float is no frame"),
    (lambda c: [], "there is no record"),
]


@pytest.mark.parametrize("make, says", WRONG)
def test_what_is_wrong_with_a_frame_is_named(make: Callable[[dict[str, Any]], Any], says: str) -> None:
    with pytest.raises(gb.Error) as raised:
        k_of(make(cooled()))
    assert says in str(raised.value), raised.value


def test_clocks_set_back_without_a_zone_are_named() -> None:
    zone = pd.Timestamp("2025-10-26 00:59:50", tz="UTC") + pd.to_timedelta(cooled()["t"], unit="s")
    local = zone.tz_convert("Europe/Berlin").tz_localize(None)
    with pytest.raises(gb.Error, match="-3599.9 s after the row before it.*tz_localize"):
        k_of({**cooled(), "t": local})


def test_measurements_may_repeat_at_an_instant() -> None:
    """Two measurements at each instant; dates take them as numbers do."""
    twice = pd.DataFrame(cooled()).loc[np.repeat(np.arange(200), 2)].reset_index(drop=True)
    twice["body"] += np.random.default_rng(3).normal(0.0, 0.05, 400)
    dated = twice.assign(t=START + pd.to_timedelta((twice["t"] * 1000).round().astype(int), unit="ms"))
    # 0.1 is not a binary number: seconds of nanoseconds are rounded once more.
    assert k_of(dated) == pytest.approx(k_of(twice), rel=1e-12)


def test_dates_of_the_day_are_times() -> None:
    days = [datetime.date(2025, 1, 1) + datetime.timedelta(days=k) for k in range(50)]
    frame = pl.DataFrame({"t": days, "a": np.arange(50.0)})
    assert Frame(frame).time(None, None, 50).tolist() == [86400.0 * k for k in range(50)]


def test_numbers_that_nothing_writes_to_are_shared() -> None:
    column = pl.DataFrame(cooled()).get_column("body").to_numpy()
    assert is_readonly(column)
    array = cooled()["body"]
    assert not is_readonly(array)
    array.flags.writeable = False
    # Its owner could make it writable again.
    assert not is_readonly(array) and not is_readonly(array[::2])


def test_a_stream_is_read_once() -> None:
    reader = pa.table(cooled()).to_reader()
    found = gb.fit(cooling(), reader, k=gb.free(1.0))
    assert found.parameters.k == k_of(cooled()) and isinstance(found.residuals(), pa.Table)
    rows = gb.fleet(cooling(), pa.table({**cooled(), "which": ["a"] * 200}).to_reader(), by="which", k=gb.free(1.0))
    assert rows.num_rows == 1


# Straight lines through steps are wrong, which a warning says.
@pytest.mark.filterwarnings("ignore::greybox.FitWarning")
def test_what_is_said_of_all_holds_for_records_that_do_not_say_it() -> None:
    c = {**cooled(), "Body": cooled()["body"]}
    del c["body"]
    said: dict[str, Any] = {"hold": "first", "columns": {"body": "Body"}}
    found = gb.fit(cooling(), c, k=gb.free(1.0), **said)
    again = gb.fit(cooling(), gb.Record(c, name="cold"), k=gb.free(1.0), **said)
    assert found.parameters.k == again.parameters.k != k_of(cooled())
    # So do predictions of other frames.
    own = np.asarray(found.predict()["body"])
    # The initial state is estimated again, to the tolerance of a search.
    assert np.allclose(np.asarray(found.predict(c)["body"]), own, rtol=1e-6)
    assert not np.allclose(np.asarray(found.predict(c, hold="zero")["body"]), own, rtol=1e-3)
    assert isinstance(found.predict(pl.DataFrame(c)), pl.DataFrame)
    for of in (None, gb.Record(c)):
        with pytest.raises(gb.Error, match="hold is said of"):
            found.predict(of, hold="zero")


def test_memory_that_arrow_shares_is_copied() -> None:
    c = cooled()
    found = gb.fit(cooling(), pa.table(c), k=gb.free(1.0))
    c["body"][:] = 0.0
    assert np.abs(np.asarray(found.residuals()["body"])).max() < 0.3


def test_a_frame_that_is_changed_during_a_fit_does_not_matter() -> None:
    c = cooled()
    found = gb.fit(cooling(), c, k=gb.free(1.0))
    c["body"][:] = 0.0
    assert np.abs(np.asarray(found.residuals()["body"])).max() < 0.3
