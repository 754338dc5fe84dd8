"""Times fleets of motors of 2,000 samples: on one core, and on Spark and Dask with one worker and with two.

Run by ``python python/benches/fleets.py [MOTORS]`` (1,000 without an argument), with the package, PySpark, Dask and psutil installed. CPU time is that of
all processes, those of the engine too, without their start; wall time tells what two workers gain, on two free cores only.
"""

from __future__ import annotations

import os
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

os.environ.setdefault("RAYON_NUM_THREADS", "1")

import numpy as np
import psutil
import pyarrow as pa
from motor import Pmsm, declared, fleet
from pyarrow import parquet

import greybox as gb
from greybox import _core
from greybox.fleets import Plan
from greybox.records import Record

FILES = 4


def spent() -> float:
    """CPU time of this process and of those that it started, also of theirs that have ended (s)."""
    total = 0.0
    for process in [psutil.Process(), *psutil.Process().children(recursive=True)]:
        try:
            times = process.cpu_times()
        except psutil.NoSuchProcess:
            continue
        total += times.user + times.system + times.children_user + times.children_system
    return total


def timed(name: str, motors: int, work: Callable[[], Any]) -> None:
    begin, wall = spent(), time.perf_counter()
    work()
    taken, wall = spent() - begin, time.perf_counter() - wall
    print(f"{name}: {1e3 * taken / motors:.3f} ms of CPU a motor, {wall:.2f} s of wall time", flush=True)


@contextmanager
def spark(workers: int) -> Iterator[Any]:
    from pyspark.sql import SparkSession

    os.environ["PYSPARK_PYTHON"] = sys.executable
    builder = SparkSession.builder.master(f"local-cluster[{workers},1,2048]").config("spark.executor.memory", "2g")
    session = builder.config("spark.ui.enabled", "false").config("spark.log.level", "ERROR").getOrCreate()
    try:
        yield session
    finally:
        session.stop()


@contextmanager
def dask(workers: int) -> Iterator[Any]:
    from dask.distributed import Client, LocalCluster

    with (
        LocalCluster(n_workers=workers, threads_per_worker=1, processes=True, dashboard_address=None) as cluster,
        Client(cluster) as client,
    ):
        yield client


def on_spark(folder: str, motors: int, said: dict[str, Any]) -> None:
    for workers in (1, 2):
        with spark(workers) as session:
            frame = session.read.parquet(folder)
            for whole in (True, False):
                # The first run compiles the engine's own program, for some seconds that a long run does not notice.
                gb.spark.fleet(Pmsm(4), frame, whole=whole, **said).collect()
                label = f"Spark, {workers} worker(s), {'whole partitions' if whole else 'shuffled'}"
                timed(label, motors, lambda whole=whole: gb.spark.fleet(Pmsm(4), frame, whole=whole, **said).collect())
            timed(f"Spark, {workers} worker(s), reading alone", motors, lambda: frame.write.format("noop").mode("overwrite").save())


def on_dask(folder: str, motors: int, said: dict[str, Any]) -> None:
    import dask.dataframe as dd

    for workers in (1, 2):
        with dask(workers):
            frame = dd.read_parquet(folder)
            for whole in (True, False):
                gb.dask.fleet(Pmsm(4), frame, whole=whole, **said).compute()
                label = f"Dask, {workers} worker(s), {'whole partitions' if whole else 'shuffled'}"
                timed(label, motors, lambda whole=whole: gb.dask.fleet(Pmsm(4), frame, whole=whole, **said).compute())


def main() -> None:
    motors = int(sys.argv[1]) if len(sys.argv) > 1 else 1000
    said: dict[str, Any] = {"by": "motor", **declared()}
    table = pa.Table.from_pandas(fleet(motors), preserve_index=False)
    plan = Plan(Pmsm(4), "motor", declared(), {}, Record(None))
    records = [Record(table.slice(2000 * k, 2000)).core(plan.equations, str(k)) for k in range(motors)]
    for _ in range(2):
        timed("fits alone", motors, lambda: _core.fleet(plan.equations.core, records, plan.declared, plan.options, None))
        timed("a table to rows", motors, lambda: plan.rows(table, ordered=True))
    mixed = table.take(np.random.default_rng(1).permutation(len(table)))
    timed("a table in random order to rows", motors, lambda: plan.rows(mixed, ordered=True))
    with tempfile.TemporaryDirectory() as folder:
        size = -(-motors // FILES) * 2000
        for k in range(FILES):
            parquet.write_table(table.slice(k * size, size), Path(folder) / f"{k}.parquet")
        for engine in (on_spark, on_dask):
            engine(folder, motors, said)


if __name__ == "__main__":
    main()
