"""Fleets on a Spark cluster (PySpark 4)."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from greybox.fleets import Plan, plan
from greybox.model import Model
from greybox.parameters import Parameter
from greybox.records import Hold, Initial, Record

__all__ = ["fleet"]

#: Records that are handed to a worker together.
_BATCH = 1000
_TYPES = {float: "double", int: "long", str: "string"}


def fleet(
    model: Model,
    frame: Any,
    /,
    by: str | Sequence[str],
    *,
    batches: int | None = None,
    whole: bool = False,
    parameters: Mapping[str, Parameter] | None = None,
    time: str | None = None,
    sample_time: float | None = None,
    columns: Mapping[str, str] | None = None,
    hold: Hold | None = None,
    initial: Initial | None = None,
    **given: Any,
) -> Any:
    """Fit many records, each by itself, on the workers of a cluster.

    The records are shuffled into batches by a hash of `by`, unless they lie in whole partitions, and each batch is one partition and one call
    of a worker, which uses one core. A task that is tried again gives the same bits. The workers need the package greybox.

    Parameters
    ----------
    frame : pyspark.sql.DataFrame
        The samples of all records, in any order.
    batches : int, optional
        Into how many parts the records are divided; without it they are counted, for some 1,000 records to a part at most, and as many
        parts for each core.
    whole : bool
        The samples of each record lie in one partition of the frame already, such as one file of whole records: nothing is shuffled, and a
        partition is one call. A record that lies in two partitions would be fitted twice, in parts. Spark cuts files into several partitions,
        unless ``spark.sql.files.openCostInBytes`` and ``spark.sql.files.maxPartitionBytes`` are both larger than the largest file.
    model, by, parameters, time, sample_time, columns, hold, initial, **given
        As in :func:`greybox.fleet`.

    Returns
    -------
    pyspark.sql.DataFrame
        Lazy, with the rows of :func:`greybox.fleet`, in no order.

    Raises
    ------
    Error
        If a column is missing, or a parameter is not declared. What is wrong with a record is the reason in its row.
    TypeError
        If the frame is none of Spark.
    """
    if not hasattr(frame, "mapInArrow"):
        raise TypeError(
            f"{type(frame).__module__}.{type(frame).__name__} is no frame of Spark; fit it on this machine by gb.fleet, or hand over "
            "spark.createDataFrame(frame)"
        )
    made = plan(model, by, parameters, Record(None, None, time, sample_time, columns, hold, initial), given)
    samples = frame.select(*map(_quoted, made.shuffled(frame.columns)))
    by = [_quoted(name) for name in made.by]
    keys = [f"{_quoted(name)} {frame.schema[name].dataType.simpleString()}" for name in made.by]
    schema = ", ".join(keys + [f"`{name}` {_TYPES[kind]}" for name, kind in made.columns().items()])
    fit = _worker(made)
    if whole:
        return samples.mapInArrow(_partition(fit), schema)
    if batches is None:
        records = frame.select(*by).distinct().count()
        cores = frame.sparkSession.sparkContext.defaultParallelism
        batches = cores * max(1, -(-records // (_BATCH * cores)))
    # A number that is asked for is not changed by adaptive execution, which would make one task of many small parts.
    return samples.repartition(batches, *by).mapInArrow(_partition(fit), schema)


def _quoted(name: str) -> str:
    """Give the name of a column as Spark reads it, whatever letters it has."""
    return f"`{name.replace('`', '``')}`"


def _worker(made: Plan) -> Callable[[Any], Any]:
    def fit(table: Any) -> Any:
        import pyarrow as pa

        # A task of Spark has one core.
        os.environ.setdefault("RAYON_NUM_THREADS", "1")
        found = pa.table(made.rows(table, ordered=True))
        # Time stamps reach a worker in the zone of the session, and Spark takes them in UTC alone: the same instants.
        zoned = {field.name: pa.timestamp(field.type.unit, "UTC") for field in found.schema if getattr(field.type, "tz", None)}
        return found.cast(pa.schema([(field.name, zoned.get(field.name, field.type)) for field in found.schema]))

    return fit


def _partition(fit: Callable[[Any], Any]) -> Callable[[Any], Any]:
    def fitted(batches: Any) -> Any:
        import pyarrow as pa

        parts = list(batches)
        if parts:
            yield from fit(pa.Table.from_batches(parts)).to_batches()

    return fitted
