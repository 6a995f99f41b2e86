"""Writes the first 1200 rows of the scanner's example recording as a laboratory has them, under names of its own and without
units, with the reference tool of each format.

    python -m venv venv && venv/bin/pip install numpy scipy h5py npTDMS pyarrow
    venv/bin/python crates/kalmems-cli/tests/own_names/make.py
"""

import csv
import pathlib

import h5py
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import scipy.io
from nptdms import ChannelObject, TdmsWriter

HERE = pathlib.Path(__file__).parent
ROWS = 1200
NAMES = {"time_s": "t", "drive_V": "Vdrive", "cap_V": "Ucap"}


def main():
    example = HERE / "../../../../examples/shared_scanner/recording.csv"
    with open(example) as file:
        rows = [row for _, row in zip(range(ROWS + 1), csv.reader(file))]
    columns = {
        NAMES[name]: np.array([float(row[i]) for row in rows[1:]]) for i, name in enumerate(rows[0])
    }
    np.savez_compressed(HERE / "own.npz", **columns)
    scipy.io.savemat(HERE / "own.mat", columns, do_compression=True)
    pq.write_table(pa.table(columns), HERE / "own.parquet")
    with h5py.File(HERE / "own.h5", "w") as file:
        for name, values in columns.items():
            file.create_dataset(name, data=values, chunks=(400,), compression="gzip", shuffle=True)
    with TdmsWriter(str(HERE / "own.tdms")) as writer:
        writer.write_segment([ChannelObject("run", name, values) for name, values in columns.items()])
    # Beside the numbers a text in each row, as programs write the operator's name.
    text = {**columns, "operator": ["somebody"] * ROWS}
    pq.write_table(pa.table(text), HERE / "text.parquet")
    # Columns that a program has and that nobody, or somebody once, filled in.
    nulls = {**columns, "remark": pa.nulls(ROWS, pa.string()), "note": ["begun"] * 3 + [None] * (ROWS - 3)}
    pq.write_table(pa.table(nulls), HERE / "nulls.parquet")
    with h5py.File(HERE / "text.h5", "w") as file:
        for name, values in columns.items():
            file.create_dataset(name, data=values, compression="gzip")
        file.create_dataset("operator", data=np.array([b"somebody"] * ROWS), compression="gzip")
    with TdmsWriter(str(HERE / "text.tdms")) as writer:
        writer.write_segment([ChannelObject("run", name, np.array(values)) for name, values in text.items()])


main()
