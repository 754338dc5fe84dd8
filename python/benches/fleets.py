"""Times fleets of motors of 2,000 samples: on one core, and on Spark and Dask with one worker and with two.

Run by ``python python/benches/fleets.py [alone] [spark] [dask] [pinned] [FILES]`` with the package, PySpark, Dask and psutil installed. Without
names all three run; without a number, on 10 files of 1,000 whole motors each, which are as many partitions.

- CPU time is that of all processes, those of the engine too. What an engine costs is its figure less that of the fits alone and that of
  reading alone.
- Each worker has made as many fits before as in two runs with one worker, since an engine compiles its own program meanwhile.
- Wall time tells what two workers gain, where other programs use no CPU meanwhile. `pinned`: each worker, with all its threads and with the
  processes that it starts, runs on one core, as in a cluster whose workers have one core each; otherwise one worker may use all cores of this
  machine. The driver is not pinned.
"""

from __future__ import annotations

import os
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
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

MOTORS = 1000
WORKERS = (1, 2)
SAID: dict[str, Any] = {"by": "motor", **declared()}
SETTINGS = {
    "spark.executor.memory": "3g",
    "spark.ui.enabled": "false",
    "spark.ui.showConsoleProgress": "false",
    "spark.log.level": "ERROR",
    # Those of chapter 19 of the guide.
    "spark.sql.files.maxPartitionBytes": "1g",
    "spark.sql.files.openCostInBytes": "1g",
    "spark.sql.execution.arrow.maxBytesPerBatch": "2147483647",
}


def spent() -> float:
    """CPU time of this process and of those that it started, also of theirs that have ended (s)."""
    total = 0.0
    for process in [psutil.Process(), *psutil.Process().children(recursive=True)]:
        with suppress(psutil.NoSuchProcess):
            times = process.cpu_times()
            total += times.user + times.system + times.children_user + times.children_system
    return total


def busy() -> float:
    """CPU time of the whole machine (s)."""
    times = psutil.cpu_times()
    return float(sum(times) - times.idle - times.iowait)


def timed(name: str, motors: int, work: Callable[[], Any]) -> None:
    begin, all_of_it, wall = spent(), busy(), time.perf_counter()
    work()
    taken, all_of_it, wall = spent() - begin, busy() - all_of_it, time.perf_counter() - wall
    others = f"others used {max(0.0, all_of_it - taken):.1f} s of CPU"
    print(f"{name}: {1e3 * taken / motors:.3f} ms of CPU a motor, {wall:.2f} s of wall time ({others})", flush=True)


def pin(workers: list[int]) -> None:
    """Keep each of the processes on a core of its own, and those that it starts from now on."""
    for core, worker in zip(sorted(os.sched_getaffinity(0)), workers, strict=False):
        for thread in psutil.Process(worker).threads():
            with suppress(ProcessLookupError):
                os.sched_setaffinity(thread.id, {core})


@contextmanager
def spark(workers: int, pinned: bool) -> Iterator[Any]:
    from pyspark.sql import SparkSession

    os.environ["PYSPARK_PYTHON"] = sys.executable
    builder = SparkSession.builder.master(f"local-cluster[{workers},1,3072]")
    for name, value in SETTINGS.items():
        builder = builder.config(name, value)
    session = builder.getOrCreate()
    try:
        while len(executors := list(_executors())) < workers:
            time.sleep(0.5)
        session.range(100).count()
        if pinned:
            pin(executors)
        yield session
    finally:
        session.stop()


def _executors() -> Iterator[int]:
    for process in psutil.Process().children(recursive=True):
        with suppress(psutil.NoSuchProcess):
            if "org.apache.spark.executor.CoarseGrainedExecutorBackend" in process.cmdline():
                yield process.pid


@contextmanager
def dask(workers: int, pinned: bool) -> Iterator[Any]:
    from dask.distributed import Client, LocalCluster

    with (
        LocalCluster(n_workers=workers, threads_per_worker=1, processes=True, dashboard_address=None) as cluster,
        Client(cluster) as client,
    ):
        if pinned:
            pin(list(client.run(os.getpid).values()))
        yield client


def on_spark(folder: str, motors: int, pinned: bool) -> None:
    for workers in WORKERS:
        with spark(workers, pinned) as session:
            frame = session.read.parquet(folder)
            works: dict[str, Callable[[], Any]] = {"reading alone": lambda: frame.write.format("noop").mode("overwrite").save()}
            for name, whole in (("whole partitions", True), ("shuffled", False)):
                works[name] = lambda whole=whole: counted(gb.spark.fleet(Pmsm(4), frame, whole=whole, **SAID).collect(), motors)
            warm(f"Spark, {workers} worker(s){', pinned' if pinned else ''}", workers, motors, works)


def on_dask(folder: str, motors: int, pinned: bool) -> None:
    import dask.dataframe as dd

    for workers in WORKERS:
        with dask(workers, pinned):
            frame = dd.read_parquet(folder)
            works: dict[str, Callable[[], Any]] = {}
            for name, whole in (("whole partitions", True), ("shuffled", False)):
                works[name] = lambda whole=whole: counted(gb.dask.fleet(Pmsm(4), frame, whole=whole, **SAID).compute(), motors)
            warm(f"Dask, {workers} worker(s){', pinned' if pinned else ''}", workers, motors, works)


def warm(label: str, workers: int, motors: int, works: dict[str, Callable[[], Any]]) -> None:
    for name, work in works.items():
        for _ in range(2 * workers):
            work()
        timed(f"{label}, {name}", motors, work)


def counted(rows: Any, motors: int) -> None:
    assert len(rows) == motors


def alone(table: pa.Table) -> None:
    plan = Plan(Pmsm(4), "motor", declared(), {}, Record(None))
    records = [Record(table.slice(2000 * k, 2000)).core(plan.equations, str(k)) for k in range(MOTORS)]
    mixed = table.take(np.random.default_rng(1).permutation(len(table)))
    for _ in range(2):
        timed("fits alone", MOTORS, lambda: _core.fleet(plan.equations.core, records, plan.declared, plan.options, None))
        timed("a table to rows", MOTORS, lambda: plan.rows(table, ordered=True))
        timed("a table in random order to rows", MOTORS, lambda: plan.rows(mixed, ordered=True))


def main() -> None:
    asked = sys.argv[1:]
    files = next((int(one) for one in asked if one.isdigit()), 10)
    parts = {one for one in asked if one in ("alone", "spark", "dask")} or {"alone", "spark", "dask"}
    table = pa.Table.from_pandas(fleet(MOTORS), preserve_index=False)
    if "alone" in parts:
        alone(table)
    with tempfile.TemporaryDirectory() as folder:
        place = table.schema.get_field_index("motor")
        for k in range(files):
            # The same records under other numbers.
            numbers = pa.array(np.repeat(np.arange(MOTORS) + MOTORS * k, 2000))
            parquet.write_table(table.set_column(place, "motor", numbers), Path(folder) / f"{k}.parquet")
        for name, engine in (("spark", on_spark), ("dask", on_dask)):
            if name in parts:
                engine(folder, MOTORS * files, "pinned" in asked)


if __name__ == "__main__":
    main()
