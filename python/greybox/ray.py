"""Fleets on Ray."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import Any

from greybox.errors import Error
from greybox.fleets import Plan, plan
from greybox.model import Model
from greybox.parameters import Parameter
from greybox.records import Hold, Initial, Record

__all__ = ["fleet"]


def fleet(
    model: Model,
    dataset: Any,
    /,
    by: str | Sequence[str],
    *,
    blocks: int | None = None,
    whole: bool = False,
    parameters: Mapping[str, Parameter] | None = None,
    time: str | None = None,
    sample_time: float | None = None,
    columns: Mapping[str, str] | None = None,
    hold: Hold | None = None,
    initial: Initial | None = None,
    **given: Any,
) -> Any:
    """Fit many records, each by itself, on the workers of Ray.

    The samples are shuffled into blocks by a hash of `by`, unless they lie in whole blocks, and each block is one task. A task that is tried again
    gives the same bits. The workers need the package greybox.

    Parameters
    ----------
    dataset : ray.data.Dataset
        The samples of all records, in any order.
    blocks : int, optional
        Into how many blocks the records are divided; without it one for each core of the cluster.
    whole : bool
        The samples of each record lie in one block of the dataset already, such as one file of whole records: nothing is shuffled. A record
        that lies in two blocks would be fitted twice, in parts. Ray cuts files of more than ``DataContext.target_max_block_size`` bytes.
    model, by, parameters, time, sample_time, columns, hold, initial, **given
        As in :func:`greybox.fleet`.

    Returns
    -------
    ray.data.Dataset
        Lazy, with the rows of :func:`greybox.fleet`, in no order.

    Raises
    ------
    Error
        If a column is missing, or a parameter is not declared. What is wrong with a record is the reason in its row.
    TypeError
        If the dataset is none of Ray.
    """
    if not (hasattr(dataset, "map_batches") and hasattr(dataset, "repartition")):
        raise TypeError(
            f"{type(dataset).__module__}.{type(dataset).__name__} is no dataset of Ray; fit it on this machine by gb.fleet, or hand over "
            "ray.data.from_pandas(frame)"
        )
    import ray

    made = plan(model, by, parameters, Record(None, None, time, sample_time, columns, hold, initial), given)
    schema = dataset.schema()
    if schema is None:
        raise Error("the dataset has no rows")
    parts = dataset.select_columns(made.shuffled(schema.names))
    if not whole:
        parts = parts.repartition(blocks or int(ray.cluster_resources().get("CPU", 1)), keys=made.by)
    return parts.map_batches(_fit, fn_args=[made], batch_size=None, batch_format="pyarrow")


def _fit(part: Any, made: Plan) -> Any:
    import pyarrow as pa

    # A task of Ray has one core.
    os.environ.setdefault("RAYON_NUM_THREADS", "1")
    kinds = {float: pa.float64(), int: pa.int64(), str: pa.string()}
    of = pa.schema([part.schema.field(name) for name in made.by] + [pa.field(name, kinds[kind]) for name, kind in made.columns().items()])
    return pa.table(made.rows(part, ordered=True)).cast(of)
