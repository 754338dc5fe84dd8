"""Fleets on Dask."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import Any

from greybox.errors import Error
from greybox.fleets import Plan, plan
from greybox.frames import has_times
from greybox.model import Model
from greybox.parameters import Parameter
from greybox.records import Hold, Initial, Record

__all__ = ["fleet"]

_TYPES = {float: "float64", int: "int64", str: "object"}


def fleet(
    model: Model,
    frame: Any,
    /,
    by: str | Sequence[str],
    *,
    npartitions: int | None = None,
    whole: bool = False,
    parameters: Mapping[str, Parameter] | None = None,
    time: str | None = None,
    columns: Mapping[str, str] | None = None,
    hold: Hold | None = None,
    initial: Initial | None = None,
    **given: Any,
) -> Any:
    """Fit many records, each by itself, on the workers of Dask.

    The samples are shuffled by `by`, unless they lie in whole partitions, and each partition is one task. A task that is tried again gives the same bits.

    Parameters
    ----------
    frame : dask.dataframe.DataFrame
        The samples of all records, in any order.
    npartitions : int, optional
        Into how many parts the records are divided; as many as the frame has without it.
    whole : bool
        The samples of each record lie in one partition of the frame already, such as one file of whole records: nothing is shuffled.
        A record that lies in two partitions would be fitted twice, in parts.
    model, by, parameters, time, columns, hold, initial, **given
        As in :func:`greybox.fleet`.

    Returns
    -------
    dask.dataframe.DataFrame
        Lazy, with the rows of :func:`greybox.fleet`, in no order.

    Raises
    ------
    Error
        If a column is missing, or a parameter is not declared. What is wrong with a record is the reason in its row.
    TypeError
        If the frame is none of Dask.
    """
    if not hasattr(frame, "map_partitions"):
        raise TypeError(
            f"{type(frame).__module__}.{type(frame).__name__} is no frame of Dask; fit it on this machine by gb.fleet, or hand over "
            "dask.dataframe.from_pandas(frame, npartitions=...)"
        )
    import pandas as pd

    if given.get("sample_time") is not None:
        raise Error("a shuffle does not keep the order of samples, which sample_time needs; add a column of the time")
    if not all(isinstance(name, str) for name in frame.columns):
        frame = frame.rename(columns=str)
    made = plan(model, by, parameters, Record(None, None, time, None, columns, hold, initial), given)
    # Raises if one is missing.
    made.needed(list(frame.columns))
    if made.record.time is None and not has_times(frame._meta):
        raise Error('there is no column `t` or `time`, and no index of times; name the column by time="..."')
    of = {name: pd.Series(dtype=_plain(frame.dtypes[name])) for name in made.by}
    meta = pd.DataFrame(of | {name: pd.Series(dtype=_TYPES[kind]) for name, kind in made.columns().items()})
    parts = frame if whole else frame.shuffle(on=made.by, npartitions=npartitions)
    return parts.map_partitions(_fit, made, meta.dtypes.to_dict(), meta=meta)


def _plain(kind: Any) -> Any:
    """Give the kind of the values of a column; of categories, which parts may not know, that of what they name."""
    categories = getattr(kind, "categories", None)
    if categories is None:
        return "object" if str(kind) == "category" else kind
    return "object" if "__UNKNOWN_CATEGORIES__" in categories else categories.dtype


def _fit(part: Any, made: Plan, types: dict[str, Any]) -> Any:
    import pandas as pd

    # A thread of a worker has one core.
    os.environ.setdefault("RAYON_NUM_THREADS", "1")
    return pd.DataFrame(made.rows(part, ordered=True)).astype(types)
