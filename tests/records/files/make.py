"""Writes the files beside it with the programs that users have: pandas, polars, pyarrow, NumPy, SciPy, h5py, hdf5storage.

    pip install pandas polars pyarrow numpy scipy h5py hdf5storage && python tests/records/files/make.py

They hold the same four samples, in the types and with the compression that these programs choose, or the mistake that their name tells.
The tests in `tests/records/columns.rs` read them.
"""

from datetime import datetime, timedelta
from decimal import Decimal
from pathlib import Path
from zoneinfo import ZoneInfo

import h5py
import hdf5storage
import numpy as np
import pandas as pd
import polars as pl
import pyarrow as pa
import pyarrow.feather
import pyarrow.parquet
import scipy.io

HERE = Path(__file__).parent
T = np.array([0.0, 0.5, 1.0, 1.5])
UD = np.array([1.5, 2.5, -3.5, 4.0])
W = np.array([10, 20, 30, 40])
ID = np.array([0.25, np.nan, 0.5, 0.75])
IQ = np.array([-1.0, -2.0, -3.0, -4.0])
# Across the end of the first of two hours between two and three, in a night in which clocks are set back.
FALL = [datetime(2025, 10, 26, 0, 59, 59, tzinfo=ZoneInfo("UTC")) + timedelta(seconds=t) for t in T]


def path(name):
    return str(HERE / name)


def frames():
    stamps = pd.Timestamp("2025-03-20 14:00") + pd.to_timedelta(T, "s")
    frame = pd.DataFrame({"time": stamps, "ud": UD, "w": W.astype("int32"), "id": ID, "iq": IQ, "remark": "x"})
    frame.to_parquet(path("pandas.parquet"))
    frame.set_index("time").astype({"ud": "float32", "iq": "int8"}).to_parquet(path("pandas_index.parquet"), compression="gzip")
    frame.assign(ud=frame.ud.astype(str)).to_parquet(path("text.parquet"))
    frame.to_parquet(path("brotli.parquet"), compression={"ud": "brotli", "remark": "brotli"})
    frame.drop(columns="ud").to_parquet(path("missing.parquet"))
    frame.iloc[:0].to_parquet(path("no_rows.parquet"))
    frame.iloc[[0, 2, 1, 3]].to_parquet(path("backwards.parquet"))
    frame.assign(w=[10, None, 30, 40]).to_parquet(path("hole.parquet"))
    frame.assign(time=[stamps[0], None, *stamps[2:]]).to_parquet(path("no_date.parquet"))

    one = pl.DataFrame({
        "time": pl.Series(FALL).dt.convert_time_zone("Europe/Berlin"),
        "ud": [Decimal("1.5"), Decimal("2.5"), Decimal("-3.5"), Decimal("4.0")],
        "w": pl.Series(W, dtype=pl.UInt16),
        "id": pl.Series([0.25, None, 0.5, 0.75], dtype=pl.Float32),
        "iq": pl.Series(IQ, dtype=pl.Int64),
    })
    one.write_parquet(path("polars.parquet"))
    one.with_columns(time=pl.Series(T * 1000), ud=pl.Series(UD)).rename({"time": "t_ms"}).write_ipc(path("polars.arrow"))
    one = one.with_columns(time=pl.Series([f"2025-03-20 14:00:0{t}" for t in T]), ud=pl.Series(UD))
    one.write_ipc(path("texts.arrow"))
    one.with_columns(iq=pl.Series([[1.0, 2.0]] * 4)).write_parquet(path("wide.parquet"))

    table = pa.table({
        "t": pa.array([0, 500_000, 1_000_000, 1_500_000], pa.duration("us")),
        "ud": pa.array(UD, pa.float64()),
        "w": pa.array(W, pa.uint8()),
        "id": pa.array(ID, pa.float16(), from_pandas=True),
        "iq": pa.array(IQ),
    })
    pyarrow.feather.write_feather(table, path("pyarrow.feather"), compression="lz4")
    with pa.ipc.new_stream(path("pyarrow.arrows"), table.schema, options=pa.ipc.IpcWriteOptions(compression="zstd")) as stream:
        stream.write_table(table, max_chunksize=3)
    pa.parquet.write_table(table, path("pyarrow.parquet"), compression="lz4", row_group_size=3)
    pyarrow.feather.write_feather(pa.table({"ud": UD}), path("feather_1.feather"), version=1)


def fleets():
    names = np.array(["b", "a", "b", "a", "c", "b", "b", "a", "a"])
    t = np.array([0.0, 0.0, 0.5, 0.5, 0.0, 1.0, 1.5, 1.0, 1.5])
    order = np.array([0, 0, 1, 1, 0, 2, 3, 2, 3])
    big = {"a": 2**62 + 1, "b": 2**62 + 2, "c": 2**62 + 3}
    frame = pd.DataFrame({"motor": pd.Categorical(names), "serial": [big[name] for name in names], "t": t,
                          "ud": UD[order], "w": W[order], "id": ID[order], "iq": IQ[order]})
    frame.to_parquet(path("motors.parquet"))
    frame.drop(columns="serial").to_csv(path("motors.csv"), index=False)
    number = frame.motor.cat.codes.to_numpy()
    np.savez(path("motors.npz"), motor=number, serial=frame.serial, **{name: frame[name] for name in ["t", "ud", "w", "id", "iq"]})


def arrays():
    np.savez(path("numpy.npz"), t=T, ud=UD.astype("<f4"), w=W.astype(">i2"), id=ID.astype(">f8"), iq=IQ.astype("i1").reshape(4, 1))
    stamps = np.datetime64("2025-03-20T14:00") + (T * 1000).astype("m8[ms]")
    np.savez_compressed(path("numpy_dates.npz"), time=stamps, ud=UD, w=W > 0, id=ID, iq=IQ)
    np.savez(path("matrix.npz"), t=T, ud=np.c_[UD, UD], w=W, id=ID, iq=IQ)
    np.savez(path("complex.npz"), t=T, ud=UD + 1j, w=W, id=ID, iq=IQ)
    np.savez(path("lengths.npz"), t=T, ud=UD[:3], w=W, id=ID, iq=IQ)
    np.save(path("single.npy"), UD)


def matlab():
    plain = {"t": T, "ud": UD, "w": W.astype("int16"), "id": ID, "iq": IQ, "remark": "bench 3"}
    scipy.io.savemat(path("scipy.mat"), plain, oned_as="column")
    scipy.io.savemat(path("scipy_compressed.mat"), {**plain, "ud": UD.astype("f4")}, do_compression=True, oned_as="row")
    scipy.io.savemat(path("scipy_structure.mat"), {"log": {**plain, "inner": {"q": IQ}, "cells": np.array(["a", 1], object)}},
                     do_compression=True)
    scipy.io.savemat(path("kinds.mat"), {**plain, "ud": UD + 1j, "w": np.c_[W, W], "id": np.array(["a", 1], object)})
    scipy.io.savemat(path("version_4.mat"), {"t": T, "ud": UD}, format="4")
    hdf5storage.savemat(path("matlab_73.mat"), {**plain, "log": {"ud": UD}}, format="7.3", oned_as="column", truncate_existing=True)
    for version in ["earliest", "v110"]:
        with h5py.File(path(f"h5py_{version}.h5"), "w", libver=(version, "v110")) as file:
            group = file.create_group("bench")
            for name, values in [("t", T), ("ud", UD.astype("f4")), ("w", W), ("id", ID), ("iq", IQ.astype(">i4"))]:
                group.create_dataset(name, data=values, chunks=(3,), compression="gzip", shuffle=True)
            group["names"] = ["a", "b", "c", "d"]
            group["both"] = np.c_[UD, UD]


frames()
fleets()
arrays()
matlab()
