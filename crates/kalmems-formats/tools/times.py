"""Writes the beginning of the scanner's recording with times since 1970, as NumPy, Arrow, h5py and npTDMS keep them.

    pip install numpy pyarrow h5py npTDMS
    python times.py

What is kept in ../tests/fixtures/times.* was written by numpy 2.4.6, pyarrow 26.0.1, h5py 3.16.0 and npTDMS 1.13.0.
"""

import os

import h5py
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from nptdms import ChannelObject, TdmsWriter

HERE = os.path.dirname(os.path.abspath(__file__))
RECORDING = os.path.join(HERE, "../../../examples/shared_scanner/recording.csv")
ROWS = 2000
# 22 November 2025, 18:00:00.123456 UTC.
START_US = 1_763_834_400_123_456


def path(name):
    return os.path.join(HERE, "../tests/fixtures", name)


time, drive, cap = np.loadtxt(RECORDING, delimiter=",", skiprows=1, max_rows=ROWS, unpack=True)
microseconds = START_US + np.round(time * 1e6).astype(np.int64)
nanoseconds = 1000 * microseconds

np.savez_compressed(path("times.npz"), time=nanoseconds.astype("datetime64[ns]"), drive_V=drive, cap_V=cap)

rows = np.zeros(ROWS, dtype=[("time", "<M8[us]"), ("drive_V", "<f4"), ("cap_V", "<f4"), ("since", "<m8[ns]")])
rows["time"] = microseconds.astype("datetime64[us]")
rows["since"] = (nanoseconds - nanoseconds[0]).astype("timedelta64[ns]")
rows["time"][7] = np.datetime64("NaT")
np.save(path("times.npy"), rows[:50])

table = {
    "time": pa.array(microseconds, pa.timestamp("us", tz="UTC")),
    "time_local": pa.array(nanoseconds, pa.timestamp("ns")),
    "time_ms": pa.array(microseconds // 1000, pa.timestamp("ms")),
    "of_day": pa.array(microseconds % 86_400_000_000, pa.time64("us")),
    "drive_V": drive,
    "cap_V": cap,
}
pq.write_table(pa.table(table), path("times.parquet"), compression="zstd")

with h5py.File(path("times.h5"), "w") as file:
    options = {"compression": "gzip", "shuffle": True}
    file.create_dataset("time_ns", data=nanoseconds, **options)
    since = file.create_dataset("since", data=microseconds - START_US, **options)
    since.attrs["units"] = "microseconds since 2025-11-22T18:00:00"
    file.create_dataset("time_s", data=microseconds / 1e6, **options)
    file.create_dataset("drive_V", data=drive, **options)
    file.create_dataset("cap_V", data=cap, **options)

with TdmsWriter(path("times.tdms")) as writer:
    stamps = microseconds[:50].astype("datetime64[us]")
    writer.write_segment([ChannelObject("rig", "time", stamps), ChannelObject("rig", "cap_V", cap[:50])])
