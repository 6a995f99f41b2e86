"""Writes the scanner's example recording in every format with the format's reference tool, under the example's names and under
names without units, estimates each, and says whether the trajectories are the same, byte for byte.

    cargo build --release -p kalmems-cli
    python -m venv venv && venv/bin/pip install numpy scipy h5py npTDMS pyarrow
    venv/bin/python crates/kalmems-formats/tools/same_estimate.py target/release/kalmems examples/shared_scanner
"""

import csv
import hashlib
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

import h5py
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import scipy.io
import scipy.io.wavfile
from nptdms import ChannelObject, TdmsWriter


OWN = {"time_s": "t", "drive_V": "Vdrive", "cap_V": "Ucap"}


def write(rows, folder):
    """All files, with what the experiment must say of a format that keeps no names."""
    names = rows[0]
    columns = {name: np.array([float(row[i]) for row in rows[1:]]) for i, name in enumerate(names)}
    numbers = np.stack(list(columns.values()), axis=1)
    with open(folder / "semicolons.csv", "w") as file:
        file.write(";".join(name.rsplit("_", 1)[0] for name in names) + "\n")
        file.write(";".join(f"({name.rsplit('_', 1)[1]})" for name in names) + "\n")
        for row in rows[1:]:
            file.write(";".join(cell.replace(".", ",") for cell in row) + "\n")
    np.savez(folder / "stored.npz", **columns)
    np.savez_compressed(folder / "packed.npz", **columns)
    fields = np.zeros(len(numbers), dtype=[(name, "<f8") for name in names])
    for name in names:
        fields[name] = columns[name]
    np.save(folder / "fields.npy", fields)
    np.save(folder / "plain.npy", numbers)
    pq.write_table(pa.table(columns), folder / "table.parquet")
    with h5py.File(folder / "columns.h5", "w") as file:
        for name in names:
            file.create_dataset(name, data=columns[name], chunks=(4096,), compression="gzip", shuffle=True)
    scipy.io.savemat(folder / "variables.mat", columns, do_compression=True)
    with TdmsWriter(str(folder / "channels.tdms")) as writer:
        writer.write_segment([ChannelObject("run", name, columns[name]) for name in names])
    own = {OWN[name]: values for name, values in columns.items()}
    np.savez(folder / "own.npz", **own)
    scipy.io.savemat(folder / "own.mat", own)
    pq.write_table(pa.table(own), folder / "own.parquet")
    with h5py.File(folder / "own.h5", "w") as file:
        for name, values in own.items():
            file.create_dataset(name, data=values)
    with TdmsWriter(str(folder / "own.tdms")) as writer:
        writer.write_segment([ChannelObject("run", name, values) for name, values in own.items()])
    rate = round((len(numbers) - 1) / (columns["time_s"][-1] - columns["time_s"][0]))
    scipy.io.wavfile.write(folder / "channels.wav", rate, numbers[:, 1:])
    named = 'format = { kind = "%s", columns = [%s] }'
    quoted = [f'"{name}"' for name in names]
    return {
        "plain.npy": named % ("npy", ", ".join(quoted)),
        "channels.wav": named % ("wav", ", ".join(quoted[1:])),
    }


def estimate(program, experiment, folder, file, hint):
    text = re.sub(r'^file = "recording.csv"$', f'file = "{file}"\n{hint}', experiment, count=1, flags=re.M)
    if file.startswith("own."):
        for name, own in OWN.items():
            mapped = f'column = "{own}", unit = "{name.rsplit("_", 1)[1]}"'
            text = text.replace(f'clock = {{ column = "{name}" }}', f"clock = {{ {mapped} }}")
            text = text.replace(f'"{name}"', f"{{ {mapped} }}")
        # The reference is sampled as the recording where it says nothing else.
        reference = 'file = "reference.csv"'
        text = text.replace(reference, reference + '\nclock = { column = "time_s" }')
    (folder / "experiment.toml").write_text(text)
    out = folder / "out"
    command = [program, "estimate", folder / "experiment.toml", "--out", out, "--force"]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
    digest = hashlib.sha256()
    for trajectory in sorted(out.glob("trajectory_*.csv")):
        digest.update(trajectory.read_bytes())
    return digest.hexdigest()


def main():
    program, example = pathlib.Path(sys.argv[1]).absolute(), pathlib.Path(sys.argv[2])
    experiment = (example / "experiment.toml").read_text()
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        for name in ("recording.csv", "reference.csv"):
            shutil.copy(example / name, folder)
        with open(folder / "recording.csv") as file:
            hints = write(list(csv.reader(file)), folder)
        files = ["recording.csv"] + sorted(
            path.name for path in folder.iterdir() if not path.name.startswith(("re", "ex"))
        )
        digests = {file: estimate(program, experiment, folder, file, hints.get(file, "")) for file in files}
    for file, digest in digests.items():
        print(f"{file:<16} {digest[:16]}")
    if len(set(digests.values())) > 1:
        sys.exit("the estimates differ")
    print(f"the same trajectories from {len(digests)} files")


main()
