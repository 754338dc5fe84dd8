"""Fleets on Spark, Dask and Ray: the rows of one machine, also where a worker is killed in the middle."""

from __future__ import annotations

import os
import shutil
import signal
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import polars as pl
import pytest
from conftest import cooled, cooling

import greybox as gb

SAID: dict[str, Any] = {"by": "which", "k": gb.free(1.0)}


@pytest.fixture(scope="module")
def bodies() -> pd.DataFrame:
    """Samples of 24 bodies in random order; one has a missing input."""
    parts = [pd.DataFrame(cooled(k=0.3 + 0.01 * k, seed=k)).assign(which=k) for k in range(24)]
    parts[5].loc[7, "room"] = np.nan
    return pd.concat(parts).sample(frac=1, random_state=1, ignore_index=True)


@pytest.fixture(scope="module")
def expected(bodies: pd.DataFrame) -> pd.DataFrame:
    rows = gb.fleet(cooling(), bodies.sort_values(["which", "t"]), **SAID)
    assert (rows["verdict"] == "failed").sum() == 1
    return rows


def check(found: pd.DataFrame, expected: pd.DataFrame) -> None:
    """The same rows, to the last bit: nothing lost, nothing twice."""
    found = found.sort_values("which", ignore_index=True)
    pd.testing.assert_frame_equal(found.astype({"which": "int64"}), expected, check_exact=True, check_dtype=False)


@pytest.fixture(scope="module")
def zoned(bodies: pd.DataFrame) -> pd.DataFrame:
    """The same, told apart by hours of a zone, one of which the clock shows twice, with units in names of columns."""
    first = pd.Timestamp("2025-10-25T23:30", tz="UTC")
    return bodies.rename(columns={"t": "t [s]", "room": "room [K]"}).assign(which=(first + pd.to_timedelta(bodies["which"], unit="h")).dt.tz_convert("Europe/Berlin"))


def check_zoned(found: pd.DataFrame, expected: pd.DataFrame) -> None:
    """The same rows, each with the hour of its record."""
    hours = (found["which"] - pd.Timestamp("2025-10-25T23:30", tz="UTC")) / pd.Timedelta(hours=1)
    check(found.assign(which=hours), expected)


def test_frames_of_one_machine_are_refused(bodies: pd.DataFrame) -> None:
    with pytest.raises(TypeError, match="pandas.*DataFrame is no frame of Dask; fit it on this machine by gb.fleet, or .*from_pandas"):
        gb.dask.fleet(cooling(), bodies, **SAID)
    with pytest.raises(TypeError, match="pandas.*DataFrame is no frame of Spark; fit it on this machine by gb.fleet, or .*createDataFrame"):
        gb.spark.fleet(cooling(), bodies, **SAID)
    with pytest.raises(TypeError, match="polars.*DataFrame is no frame of Dask"):
        gb.dask.fleet(cooling(), pl.from_pandas(bodies), **SAID)
    with pytest.raises(TypeError, match="pandas.*DataFrame is no dataset of Ray; fit it on this machine by gb.fleet, or .*from_pandas"):
        gb.ray.fleet(cooling(), bodies, **SAID)


@pytest.fixture(scope="module")
def spark() -> Iterator[Any]:
    sql = pytest.importorskip("pyspark.sql")
    if shutil.which("java") is None:
        pytest.skip("Java is absent")
    os.environ["PYSPARK_PYTHON"] = sys.executable
    builder = sql.SparkSession.builder.master("local-cluster[2,1,1024]").appName("greybox")
    for name, value in {"spark.ui.enabled": "false", "spark.sql.shuffle.partitions": "4", "spark.task.maxFailures": "8"}.items():
        builder = builder.config(name, value)
    session = builder.getOrCreate()
    yield session
    session.stop()


def test_spark(spark: Any, bodies: pd.DataFrame, expected: pd.DataFrame) -> None:
    from pyspark.sql import functions

    frame = spark.createDataFrame(bodies)
    check(gb.spark.fleet(cooling(), frame, batches=6, **SAID).toPandas(), expected)
    both = gb.spark.fleet(cooling(), frame, batches=2, **SAID).select(functions.spark_partition_id())
    assert both.distinct().count() == 2, "each batch has a task of its own"
    whole = frame.repartition(3, "which")
    check(gb.spark.fleet(cooling(), whole, whole=True, **SAID).toPandas(), expected)
    with pytest.raises(gb.Error, match="there is no column `Room`"):
        gb.spark.fleet(cooling(), frame, columns={"room": "Room"}, **SAID)
    with pytest.raises(gb.Error, match="no column `t` or `time`"):
        gb.spark.fleet(cooling(), frame.drop("t"), **SAID)


def test_zoned_keys_on_spark(spark: Any, zoned: pd.DataFrame, expected: pd.DataFrame) -> None:
    # Spark knows the instant alone, and hands it over in the zone of the session.
    spark.conf.set("spark.sql.session.timeZone", "Europe/Berlin")
    frame = spark.createDataFrame(zoned)
    check_zoned(gb.spark.fleet(cooling(), frame, batches=3, **SAID).toArrow().to_pandas(), expected)


def test_spark_with_an_executor_killed(
    spark: Any, bodies: pd.DataFrame, expected: pd.DataFrame, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from greybox import spark as adapter

    mark, make = str(tmp_path / "killed"), adapter._worker

    def mortal(made: Any) -> Any:
        fit = make(made)

        def killing(table: Any) -> Any:
            try:
                os.close(os.open(mark, os.O_CREAT | os.O_EXCL))
            except FileExistsError:
                return fit(table)
            # This process is the daemon's, which is the executor's.
            with open(f"/proc/{os.getppid()}/stat") as stat:
                os.kill(int(stat.read().rpartition(")")[2].split()[1]), signal.SIGKILL)
            time.sleep(60)

        return killing

    monkeypatch.setattr(adapter, "_worker", mortal)
    found = gb.spark.fleet(cooling(), spark.createDataFrame(bodies), batches=6, **SAID).toPandas()
    assert os.path.exists(mark)
    check(found, expected)


@pytest.fixture(scope="module")
def dask_client() -> Iterator[Any]:
    distributed = pytest.importorskip("dask.distributed")
    with (
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None) as cluster,
        distributed.Client(cluster) as client,
    ):
        yield client


def test_dask(dask_client: Any, bodies: pd.DataFrame, expected: pd.DataFrame) -> None:
    import dask.dataframe as dd

    frame = dd.from_pandas(bodies, npartitions=4)
    check(gb.dask.fleet(cooling(), frame, **SAID).compute(), expected)
    whole = dd.from_pandas(bodies.sort_values("which", ignore_index=True), npartitions=1)
    check(gb.dask.fleet(cooling(), whole, whole=True, **SAID).compute(), expected)
    with pytest.raises(gb.Error, match="there is no column `Room`"):
        gb.dask.fleet(cooling(), frame, columns={"room": "Room"}, **SAID)


def test_zoned_keys_on_dask(dask_client: Any, zoned: pd.DataFrame, expected: pd.DataFrame) -> None:
    import dask.dataframe as dd

    rows = gb.dask.fleet(cooling(), dd.from_pandas(zoned, npartitions=4), **SAID)
    found = rows.compute()
    assert rows.dtypes["which"] == found["which"].dtype == zoned["which"].dtype
    check_zoned(found, expected)


def test_dask_with_a_worker_killed(
    dask_client: Any, bodies: pd.DataFrame, expected: pd.DataFrame, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import dask.dataframe as dd

    from greybox import dask as adapter

    mark, fit = str(tmp_path / "killed"), adapter._fit

    def killing(part: Any, made: Any, types: Any) -> Any:
        try:
            os.close(os.open(mark, os.O_CREAT | os.O_EXCL))
        except FileExistsError:
            return fit(part, made, types)
        os.kill(os.getpid(), signal.SIGKILL)
        return None

    monkeypatch.setattr(adapter, "_fit", killing)
    found = gb.dask.fleet(cooling(), dd.from_pandas(bodies, npartitions=4), **SAID).compute()
    assert os.path.exists(mark)
    check(found, expected)


@pytest.fixture(scope="module")
def ray() -> Iterator[Any]:
    ray = pytest.importorskip("ray")
    pytest.importorskip("ray.data")
    # Workers have a low priority, and would wait for programs that run beside the tests.
    os.environ["RAY_worker_niceness"] = "0"
    # They find the tests' modules by the path of this process.
    path = {"env_vars": {"PYTHONPATH": ":".join(sys.path)}}
    ray.init(num_cpus=2, include_dashboard=False, logging_level="ERROR", log_to_driver=False, runtime_env=path)
    context = ray.data.DataContext.get_current()
    context.enable_progress_bars = False
    # So small that the samples of a record would lie in several blocks if blocks were cut.
    context.target_max_block_size = 2_000
    yield ray
    ray.shutdown()


def test_whole_blocks_on_ray(ray: Any, bodies: pd.DataFrame, zoned: pd.DataFrame, expected: pd.DataFrame) -> None:
    frame = ray.data.from_pandas(bodies)
    check(gb.ray.fleet(cooling(), frame, whole=True, **SAID).to_pandas(), expected)
    check_zoned(gb.ray.fleet(cooling(), ray.data.from_pandas(zoned), whole=True, **SAID).to_pandas(), expected)
    with pytest.raises(gb.Error, match="there is no column `Room`"):
        gb.ray.fleet(cooling(), frame, columns={"room": "Room"}, **SAID)
    with pytest.raises(gb.Error, match="no column `t` or `time`"):
        gb.ray.fleet(cooling(), frame.drop_columns(["t"]), **SAID)
    with pytest.raises(gb.Error, match="there is no column `when`"):
        gb.ray.fleet(cooling(), frame, time="when", **SAID)
    with pytest.raises(gb.Error, match="which sample_time needs"):
        gb.ray.fleet(cooling(), frame, sample_time=0.1, **SAID)
    with pytest.raises(gb.Error, match="the dataset has no rows"):
        gb.ray.fleet(cooling(), ray.data.from_items([]), **SAID)


def test_ray_with_a_worker_killed(
    ray: Any, zoned: pd.DataFrame, expected: pd.DataFrame, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from greybox import ray as adapter

    mark, fit = str(tmp_path / "killed"), adapter._fit

    def killing(part: Any, made: Any) -> Any:
        try:
            os.close(os.open(mark, os.O_CREAT | os.O_EXCL))
        except FileExistsError:
            return fit(part, made)
        os.kill(os.getpid(), signal.SIGKILL)
        return None

    monkeypatch.setattr(adapter, "_fit", killing)
    found = gb.ray.fleet(cooling(), ray.data.from_pandas(zoned), **SAID).to_pandas()
    assert os.path.exists(mark)
    check_zoned(found, expected)
