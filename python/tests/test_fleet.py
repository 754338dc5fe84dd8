"""Fleets: a row for each record."""

from __future__ import annotations

import pickle
from typing import Any

import numpy as np
import pandas as pd
import polars as pl
import pytest
from conftest import cooled, cooling

import greybox as gb


def bodies(count: int = 40) -> pd.DataFrame:
    """Bodies that cool down at 0.30, 0.31, ..., with three that cannot be fitted."""
    parts = [pd.DataFrame(cooled(k=0.3 + 0.01 * k, seed=k)).assign(which=f"body {k}", place=k % 2) for k in range(count)]
    spoiled = {3: parts[3].assign(room=np.nan), 5: parts[5].iloc[:1], 7: parts[7].assign(body=np.nan)} if count > 7 else {}
    return pd.concat([spoiled.get(k, part) for k, part in enumerate(parts)], ignore_index=True)


def test_a_row_for_each_record_and_failures_are_rows() -> None:
    frame = bodies()
    rows = gb.fleet(cooling(), frame, by="which", k=gb.free(1.0))
    assert isinstance(rows, pd.DataFrame)
    assert rows["which"].tolist() == [f"body {k}" for k in range(40)]
    failed = rows["verdict"] == "failed"
    assert np.flatnonzero(failed).tolist() == [3, 5, 7]
    assert "only outputs may be missing" in rows["reason"][3]
    assert "2 or more are needed" in rows["reason"][5] and "missing in every sample" in rows["reason"][7]
    assert np.isnan(rows["k"][failed]).all()
    good = rows[~failed]
    truth = 0.3 + 0.01 * good.index.to_numpy()
    # Of 37 intervals of 95 %, 35 are expected to cover; 31 or fewer are, by chance, one case in 100.
    assert ((good["k_lower"] < truth) & (truth < good["k_upper"])).sum() >= 31
    assert good["samples"].eq(200).all() and good["reason"].eq("").all()
    assert good["body_rmse"].between(0.04, 0.06).all()


def test_a_missing_date_spoils_one_record_alone() -> None:
    start = pd.Timestamp("2025-03-20 14:00", tz="Europe/Berlin")
    frame = bodies(3).assign(t=lambda f: start + pd.to_timedelta(f["t"], unit="s"))
    frame.loc[250, "t"] = pd.NaT
    for of in (frame, pl.from_pandas(frame)):
        rows = gb.fleet(cooling(), of, by="which", k=gb.free(1.0))
        assert list(rows["verdict"])[1] == "failed" and "rows without a time" in list(rows["reason"])[1]
        assert [verdict != "failed" for verdict in rows["verdict"]] == [True, False, True]


def test_records_of_one_input_each_and_keys_with_gaps() -> None:
    parts = [pd.DataFrame(cooled(k=0.3 + 0.1 * k, seed=k)).assign(room=20.0 + k) for k in range(2)]
    rows = gb.fleet(cooling(), pd.concat(parts, ignore_index=True), by="room", k=gb.free(1.0))
    assert rows["room"].tolist() == [20.0, 21.0]
    large = pl.DataFrame(bodies(3).drop(columns="which")).with_columns(
        serial=pl.Series([9007199254740993] * 200 + [9007199254740992] * 200 + [None] * 200)
    )
    assert len(gb.fleet(cooling(), large, by="serial", k=gb.free(1.0))) == 3


def test_zoned_stamps_are_keys_as_they_are() -> None:
    # A clock that shows 02:30 twice.
    stamps = pd.to_datetime(["2025-10-26T00:30", "2025-10-26T01:30", "2025-10-26T02:30"], utc=True).tz_convert("Europe/Berlin")
    frame = bodies(3).assign(which=stamps.repeat(200))
    frame.loc[200:399, "body"] = np.nan
    polars = pl.from_pandas(frame)
    for of in (frame, polars, polars.to_arrow(), frame.set_index(np.arange(600) + 7)):
        rows = gb.fleet(cooling(), of, by="which", k=gb.free(1.0))
        keys = rows["which"] if isinstance(rows, pd.DataFrame) else rows["which"].to_pandas()
        assert pd.DatetimeIndex(list(keys)).equals(stamps)
        assert "2025-10-26 02:30:00+01:00" in str(list(rows["reason"])[1])
    assert gb.fleet(cooling(), frame, by="which", k=gb.free(1.0))["which"].dtype == frame["which"].dtype
    assert gb.fleet(cooling(), polars, by="which", k=gb.free(1.0)).schema["which"] == polars.schema["which"]


def test_each_row_is_the_single_fit() -> None:
    frame = bodies(6)
    rows = gb.fleet(cooling(), frame, by="which", k=gb.free(1.0))
    single = gb.fit(cooling(), frame[frame["which"] == "body 2"], k=gb.free(1.0))
    # Up to rounding: both searches stop at a relative step of 1e-10.
    assert rows["k"][2] == pytest.approx(single.parameters.k, rel=1e-9)
    assert rows["k_error"][2] == pytest.approx(single.standard_errors.k, rel=1e-6)


def test_kinds_orders_and_keys_give_the_same_bits() -> None:
    frame = bodies()
    rows = gb.fleet(cooling(), frame, by="which", k=gb.free(1.0))
    polars = gb.fleet(cooling(), pl.from_pandas(frame), by="which", k=gb.free(1.0))
    assert isinstance(polars, pl.DataFrame) and np.array_equal(polars["k"].to_numpy(), rows["k"], equal_nan=True)
    mixed = frame.sort_values("t", kind="stable")
    again = gb.fleet(cooling(), mixed, by="which", k=gb.free(1.0)).sort_values("which", ignore_index=True)
    assert np.array_equal(again["k"], rows.sort_values("which")["k"], equal_nan=True)
    two = gb.fleet(cooling(), frame, by=["place", "which"], k=gb.free(1.0))
    assert np.array_equal(two["k"], rows["k"], equal_nan=True) and two["place"].tolist() == [k % 2 for k in range(40)]


def test_dates_count_from_the_first_of_each_record() -> None:
    frame = bodies(3)
    start = pd.to_datetime("2025-03-20") + pd.to_timedelta(frame["which"].str[5:].astype(int) * 1000, unit="h")
    dated = frame.assign(t=start + pd.to_timedelta((frame["t"] * 1000).round().astype(int), unit="ms"))
    rows = gb.fleet(cooling(), dated, by="which", k=gb.free(1.0))
    single = gb.fleet(cooling(), frame, by="which", k=gb.free(1.0))
    # 0.1 is not a binary number: seconds of nanoseconds are rounded once more.
    assert np.allclose(rows["k"], single["k"], rtol=1e-12)


WRONG: list[tuple[dict[str, Any], str]] = [
    ({"by": "what", "k": gb.free(1.0)}, "there is no column `what`"),
    ({"by": "which"}, "parameter `k` is not declared"),
    ({"by": "which", "k": gb.free(1.0), "columns": {"body": "bdy"}}, "there is no column `bdy`"),
    ({"by": "which", "k": gb.free(1.0), "checkpoint": "c"}, "a fleet has no checkpoint"),
    ({"by": "which", "k": gb.free(1.0), "loss": gb.free(1.0)}, "`loss` is an option"),
    ({"by": "which", "k": gb.free(1.0), "loss": "hubber"}, "hubber"),
    ({"by": "which", "k": gb.free(1.0), "hold": "linear"}, "there is no hold `linear`"),
    ({"by": "which", "k": gb.free(1.0), "sample_time": 0.0}, "must be positive"),
    ({"by": "which", "k": gb.free(1.0), "columns": {"rom": "T"}}, "columns names `rom`"),
    ({"by": "which", "k": gb.free(1.0), "columns": "room"}, "give the column of each signal"),
    ({"by": "which", "k": gb.free(1.0), "initial": {"bdy": gb.fixed(0.0)}}, "there is no initial state of `bdy`"),
    ({"by": "which", "k": gb.free(1.0), "noise": 0.1}, "give a standard deviation for each"),
    ({"by": "which", "k": gb.free(1.0), "sample_time": 0.1, "time": "t"}, "both give the time of the samples; leave one out"),
    ({"by": [], "k": gb.free(1.0)}, "by is []; name at least one column that tells the records apart"),
    ({"by": None, "k": gb.free(1.0)}, "by is None; give the name of a column"),
    ({"by": ["which", 2.5], "k": gb.free(1.0)}, "by is 2.5; give the name of a column"),
    ({"by": 3, "k": gb.free(1.0)}, "there is no column `3`"),
    ({"by": "which", "k": gb.free(1.0), "starts": 2**70}, "starts is 1180591620717411303424"),
    ({"by": "which", "k": gb.free(1.0), "sample_time": "0.1"}, "sample_time is '0.1'; give a number"),
    ({"by": "which", "k": gb.free(1.0), "time": 0}, "there is no column `0`"),
]


@pytest.mark.parametrize("said, says", WRONG)
def test_what_is_wrong_with_all_records_is_an_error(said: dict[str, Any], says: str) -> None:
    with pytest.raises(gb.Error) as raised:
        gb.fleet(cooling(), bodies(2), **said)
    assert says in str(raised.value), raised.value


def test_keys_of_other_kinds_are_other_records() -> None:
    frame = bodies(3)
    for keys in ([1, "1", 2], [1, None, "None"], [1, float("nan"), "nan"], [1, pd.NA, "<NA>"]):
        of = frame.assign(which=pd.Series(np.repeat(np.array(keys, dtype=object), 200), dtype=object))
        rows = gb.fleet(cooling(), of, by="which", k=gb.free(1.0))
        assert rows["samples"].tolist() == [200] * 3 and str(rows["which"].tolist()) == str(keys)
        # Also where the rows of a record do not follow each other.
        mixed = gb.fleet(cooling(), of.sort_values("t", kind="stable"), by="which", k=gb.free(1.0))
        assert np.array_equal(mixed["k"], rows["k"])
    lists = {**{name: frame[name].to_numpy() for name in ("t", "room", "body")}, "which": [1] * 200 + ["1"] * 200 + [2] * 200}
    assert gb.fleet(cooling(), lists, by="which", k=gb.free(1.0))["samples"] == [200] * 3
    with pytest.raises(gb.Error, match="column `room` has 600 rows, and column `which` has 599; every sample needs both"):
        gb.fleet(cooling(), {**lists, "which": lists["which"][:-1]}, by="which", k=gb.free(1.0))


def test_columns_of_the_result_have_names_of_their_own() -> None:
    model = gb.model(
        lambda t, x, u, p: [p.k * p.k_error * (u.room - x.body)], states=["body"], inputs=["room"], outputs=["body"], parameters=["k", "k_error"]
    )
    with pytest.raises(gb.Error, match="the result would have two columns `k_error`; rename the parameter"):
        gb.fleet(model, bodies(2), by="which", k=gb.free(1.0), k_error=gb.fixed(1.0))


def test_progress(capsys: pytest.CaptureFixture[str]) -> None:
    gb.fleet(cooling(), bodies(4), by="which", k=gb.free(1.0), progress=True)
    assert "fleet" in capsys.readouterr().err


def test_a_plan_pickles() -> None:
    from greybox.fleets import plan

    made = plan(cooling(), "which", None, gb.Record(None), {"k": gb.free(1.0)})
    again = pickle.loads(pickle.dumps(made))
    frame = bodies(2)
    assert again.rows(frame)["k"] == made.rows(frame)["k"]
