"""Takes files that instruments wrote out of public repositories, and writes beside each what NumPy, npTDMS or h5py reads from it, for
tests/differential.rs. Nothing of them is kept in this repository.

    git clone https://github.com/scottprahl/RigolWFM CLONES/RigolWFM   (and the others that SOURCES names)
    venv/bin/python crates/kalmems-formats/tools/public_exports.py CLONES FOLDER
    KALMEMS_EXPORT_FILES=FOLDER cargo test -p kalmems-formats --test differential -- --ignored instruments

How a text is to be read (lines to pass over, separator, decimal mark, names and units, clock) is said here for each file, from its
maker's manual, and by nothing of kalmems. The lines of FOLDER/NAME.expected are those of tools/differential.py.
"""

import os
import struct
import subprocess
import sys

import h5py
import numpy as np
from nptdms import TdmsFile

CLONES, FOLDER = sys.argv[1:3]
os.makedirs(FOLDER, exist_ok=True)
# The folder of the clone: its address, the commit that is read, and the licence of what is in it.
SOURCES = {
    "RigolWFM": ("https://github.com/scottprahl/RigolWFM", "159e647c0b74e1d73d0ad589149e1c26e1610b26", "BSD-3-Clause"),
    "lvm_read": ("https://github.com/openmodal/lvm_read", "45c1ad68c0d1ad40bc8b697348a4bf8ae70e5a8f", "GPL-3.0"),
    "nanonis-xarray": ("https://github.com/angelo-peronio/nanonis-xarray", "7004841d87701b1c1428aab934a864721f13ac2c", "MIT"),
    "npTDMS": ("https://github.com/adamreeve/npTDMS", "824119ee0a99db33a8a442e38c8a4fd9a0d4f6de", "LGPL-3.0"),
    "mat7.3": ("https://github.com/skjerns/mat7.3", "d686b80f33cc8ce46115cf09ff5ca4382bb89198", "GPL-3.0"),
    "Fusion": ("https://github.com/xioTechnologies/Fusion", "d69784c8f7058a6545802b8852d26d6fcfd5e119", "MIT"),
    "Gait-Tracking-With-x-IMU": ("https://github.com/xioTechnologies/Gait-Tracking-With-x-IMU", "f877838b4dba55a8f32442275e2c10f56035f3a2",
                                 "none stated"),
    "NGIMU": ("https://github.com/xioTechnologies/NGIMU-MATLAB-Import-Logged-Data-Example", "fb69298e59c74003e17748fa1a7547b8fb3b8a7d",
              "none stated"),
    "allantools": ("https://github.com/aewallin/allantools", "599dc9ea133ea4852f97e5ed88e51dc11bbdae1f", "LGPL-3.0"),
}
table, paths = [], {}


def take(source, path, name=None):
    """The file from the commit of the clone that SOURCES names."""
    raw = subprocess.run(["git", "-C", os.path.join(CLONES, source), "show", f"{SOURCES[source][1]}:{path}"], check=True,
                         capture_output=True).stdout
    name = name or os.path.basename(path)
    paths[name] = path
    with open(os.path.join(FOLDER, name), "wb") as file:
        file.write(raw)
    return name, raw


def cell(number):
    number = float(number)
    return "missing" if number != number else struct.pack(">d", number).hex()


def expect(source, name, instrument, columns, hints=(), refused=None):
    with open(os.path.join(FOLDER, name + ".expected"), "w", encoding="utf-8", newline="\n") as file:
        for hint in hints:
            file.write("\t".join(hint) + "\n")
        if refused:
            file.write(f"refused\t{refused}\n")
        for column, values in columns.items():
            file.write("\t".join(["column", column] + [cell(value) for value in values]) + "\n")
    rows = len(next(iter(columns.values()))) if columns else 0
    table.append((instrument, source, name, len(columns), rows, refused or "read"))


def numbers(raw, skip, separator=",", decimal=".", end=None):
    """The columns of the rows behind some lines."""
    lines = raw.decode("latin-1").replace(decimal, ".").splitlines()[skip:end]
    lines = [line.strip().rstrip(separator).strip() for line in lines if line.strip()]
    return np.genfromtxt(lines, delimiter=separator, dtype="f8", ndmin=2).T


# ---- Rigol: the clock in the second line, or times -----------------------------------------------------------------------
WFM = "tests/files/wfm/"
for name in ["DS1054Z-A", "DS1054Z-ch1SquareCH2Uart", "DS1054Z-ch1SquareCH4Uart", "DS1074Z-A", "DS1074Z-B", "DS2072A-1", "DS2072A-2", "DS2072A-3",
             "DS2072A-4", "DS2072A-5", "DS2072A-6", "DS2072A-7", "DS2072A-9", "DS4024-A", "DS4024-B"]:
    file, raw = take("RigolWFM", WFM + name + ".csv")
    head, values = [line.split(",") for line in raw.decode().splitlines()[:2]]
    start = head.index("Start")
    data = numbers(raw, 2)
    columns = {"time_s": float(values[start]) + data[0] * float(values[start + 1])}
    columns |= {f"{channel}_V": data[k + 1] for k, channel in enumerate(head[1:start])}
    expect("RigolWFM", file, f"Rigol {name.split('-')[0]}", columns)
for name, skip, names in [
    ("DS1052E", 16, ["time_s", "CH 1_V", "CH 2_V"]),
    ("DS1102D-A", 1, ["X", "CH 1_V", "CH 2_V"]),
    ("DS1102E-B", 2, ["X_s", "CH1_V"]),
    ("DS1102E-D", 2, ["X_s", "CH1_V", "CH2_V"]),
    ("DS1204B-A-original", 2, ["time_s", "CH1_V", "CH2_V", "CH3_V", "CH4_V"]),
    ("DS1204B-F", 2, ["time_s", "CH2_V", "CH4_V"]),
]:
    file, raw = take("RigolWFM", WFM + name + ".csv")
    expect("RigolWFM", file, f"Rigol {name.split('-')[0]}", dict(zip(names, numbers(raw, skip))))
# ---- Rohde & Schwarz RTP: no names -----------------------------------------------------------------------------------------
for name, names in [("01", ["a"]), ("02", ["a", "b"]), ("04", ["t", "a"]), ("05", ["t", "a", "b"])]:
    file, raw = take("RigolWFM", f"tests/files/rs/rs_rtp_{name}.Wfm.csv")
    data = numbers(raw, 0)
    expect("RigolWFM", file, "Rohde & Schwarz RTP", dict(zip(names, data)), [["columns", *names]])
# ---- LabVIEW: `.lvm` ---------------------------------------------------------------------------------------------------------
for name, decimal, start, step, rows, names in [
    ("short", ",", 0.0, 3.90625e-5, (23, None), ["Excitation (Trigger)_N", "Response (Trigger)_m_per_s2"]),
    ("short_new_line_end", ",", 0.0, 3.90625e-5, (23, 33), ["Excitation (Trigger)_N", "Response (Trigger)_m_per_s2"]),
]:
    file, raw = take("lvm_read", f"data/{name}.lvm")
    rows = [line.split("\t") for line in raw.decode("latin-1").splitlines()[rows[0]:rows[1]] if line.strip()]
    data = [[float(row[k + 1].replace(",", ".")) for row in rows] for k in range(len(names))]
    expect("lvm_read", file, "LabVIEW", {"time_s": [start + k * step for k in range(len(rows))], **dict(zip(names, data))})
for name, names in [
    ("multi_time_column", ["time_s", "Voltage_V", "time of Acceleration_s", "Acceleration_g"]),
    ("no_decimal_separator", ["time_s", "ax_g", "time of ay_s", "ay_g", "time of az_s", "az_g"]),
]:
    file, raw = take("lvm_read", f"data/{name}.lvm")
    text = raw.decode("latin-1").splitlines()
    first = max(k for k, line in enumerate(text) if line.startswith("X_Value")) + 1
    rows = [line.split("\t") for line in text[first:] if line.strip()]
    data = [[float(row[k].replace(",", ".")) for row in rows] for k in range(len(names))]
    expect("lvm_read", file, "LabVIEW", dict(zip(names, data)))
for name, names in [
    ("with_comments", ["time_s", "Pressão ABS._MPa", "Temperatura_degC", "Volume (ml)_ml"]),
    ("with_empty_fields", ["time_s", "Dev0/Ai0", "Dev0/Ai2", "Untitled", "Untitled 1", "Untitled 2", "Untitled 3", "Dev0/Ai0 1"]),
]:
    file, raw = take("lvm_read", f"data/{name}.lvm")
    text = raw.decode("utf-8", "replace").splitlines()
    first = max(k for k, line in enumerate(text) if line.startswith("X_Value")) + 1
    rows = [(line.split("\t") + [""] * 9) for line in text[first:] if line.strip()]
    number = lambda word: float(word.replace(",", ".")) if word.strip() else float("nan")
    expect("lvm_read", file, "LabVIEW", {column: [number(row[k]) for row in rows] for k, column in enumerate(names)})
# ---- Nanonis: settings, `[DATA]`, names with units in brackets ----------------------------------------------------------------
for name in ["a", "df_v", "filtered", "i_v", "z"]:
    file, raw = take("nanonis-xarray", f"tests/data/{name}.dat")
    text = raw.decode("latin-1").splitlines()
    begin = text.index("[DATA]") + 1
    head = [column.strip() for column in text[begin].rstrip("\t").split("\t")]
    data = numbers(raw, begin + 1, "\t")
    known = ["(V)", "(A)", "(m)", "(deg)", "(Hz)", "(ms)"]
    named = [column.rsplit(" ", 1)[0] + "_" + column.rsplit(" ", 1)[1][1:-1] if column.rsplit(" ", 1)[-1] in known else column for column in head]
    expect("nanonis-xarray", file, "Nanonis", dict(zip(named, data)))
# ---- TDMS by npTDMS -------------------------------------------------------------------------------------------------------------
for name, group in [("big_endian", None), ("raw_timestamps", None),
                    ("Digital_Input", "07/09/2012 06:58:23 PM - Digital Input - All Data")]:
    file, _ = take("npTDMS", f"nptdms/test/data/{name}.tdms")
    with TdmsFile.open(os.path.join(FOLDER, file)) as read:
        chosen = read[group] if group else next(group for group in read.groups() if group.channels())
        columns = {channel.name + "*": channel[:] for channel in chosen.channels() if channel[:].dtype.kind in "fiu"}
    expect("npTDMS", file, "LabVIEW TDMS", columns, [["group", group]] if group else [])
file, _ = take("npTDMS", "nptdms/test/data/raw1.tdms")
expect("npTDMS", file, "LabVIEW TDMS (DAQmx)", {}, refused="raw values that DAQmx has logged")
# ---- MATLAB 7.3 by h5py -----------------------------------------------------------------------------------------------------------
for name, group, places in [
    ("testfile1", None, {"secondvar": "/secondvar"}),
    ("testfile6", None, {"B": "/B"}),
    ("testfile13", "/A", {"jc": "/A/jc"}),
    ("testfile15", None, {"x_10": "/x_10", "x_10_1": "/x_10_1"}),
    ("testfile4", "/Res/HRV/Frequency/Welch", None),
]:
    file, _ = take("mat7.3", f"tests/{name}.mat")
    with h5py.File(os.path.join(FOLDER, file)) as read:
        if places is None:
            places = {key: f"{group}/{key}" for key, item in read[group].items() if isinstance(item, h5py.Dataset) and item.size > 1
                      and 1 in item.shape and item.dtype.kind == "f"}
        columns = {column: read[place][()].ravel() for column, place in places.items()}
    expect("mat7.3", file, "MATLAB 7.3", columns, [["group", group]] if group else [])

# ---- x-io: x-IMU, NGIMU, x-IMU3, by NumPy -------------------------------------------------------------------------------------
def named_csv(source, path, instrument, name):
    """Names in the first line, one row a line; a name is compared up to its unit."""
    file, raw = take(source, path, name)
    head = raw.decode("utf-8").splitlines()[0].split(",")
    expect(source, file, instrument, {column.split(" (")[0] + "*": values for column, values in zip(head, numbers(raw, 1))})


named_csv("Fusion", "Examples/Python/sensor_data.csv", "x-io x-IMU3", "x_imu3.csv")
for walk in ["spiralStairs", "stairsAndCorridor", "straightLine"]:
    named_csv("Gait-Tracking-With-x-IMU", f"Gait Tracking With x-IMU/Datasets/{walk}_CalInertialAndMag.csv", "x-io x-IMU", f"{walk}.csv")
for unit in ["Blue - 0029D0B4", "Green - 0029C1DA", "Red - 0029B94A"]:
    for kind in ["sensors", "quaternion", "battery", "humidity", "temperature"]:
        named_csv("NGIMU", f"My Session/NGIMU-{unit}/{kind}.csv", f"x-io NGIMU {unit[-8:]}", f"ngimu_{unit[-8:]}_{kind}.csv")
# ---- Keysight 53230A: comments, and a column of numbers, by NumPy -----------------------------------------------------------------
for path, column in [("Keysight53230A_ti_noise_floor/tic_phase.txt", "phase_s"), ("ocxo/ocxo_frequency.txt", "frequency_Hz")]:
    file, raw = take("allantools", f"tests/{path}")
    values = np.loadtxt(raw.decode("utf-8").splitlines())
    expect("allantools", file, f"Keysight 53230A ({file.split('_')[0]})", {column: values}, [["columns", column]])

print("| instrument | repository (licence) | commit | path | columns | rows | outcome |\n|---|---|---|---|---|---|---|")
for instrument, source, name, columns, rows, outcome in table:
    address, commit, licence = SOURCES[source]
    print(f"| {instrument} | {address.removeprefix('https://github.com/')} ({licence}) | {commit[:10]} | {paths[name]} | {columns} | {rows} | {outcome} |")
print(len(table), "files of", len({instrument for instrument, *_ in table}), "instruments and programs")
