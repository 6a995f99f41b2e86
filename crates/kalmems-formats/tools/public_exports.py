"""Takes files that instruments wrote out of public repositories, and writes next to each what NumPy, npTDMS or h5py reads from it, for
tests/differential.rs. Nothing of them is kept in this repository.

    git clone https://github.com/scottprahl/RigolWFM CLONES/RigolWFM   (and the others that SOURCES names)
    venv/bin/python crates/kalmems-formats/tools/public_exports.py CLONES FOLDER
    KALMEMS_EXPORT_FILES=FOLDER cargo test -p kalmems-formats --test differential -- --ignored instruments

How a text is to be read (lines to pass over, separator, decimal mark, names and units, clock) is said here for each file, from its
maker's manual, and by nothing of kalmems. The lines of FOLDER/NAME.expected are those of tools/differential.py.
"""

import gzip
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
    "scikit-kinematics": ("https://github.com/thomas-haslwanter/scikit-kinematics", "14bed21f56327cabb031cde072735e1cf995d657", "BSD-2-Clause"),
    "pyABF": ("https://github.com/swharden/pyABF", "3ad9cd6f2cdfe79bc1978736ab46314866ca1c4c", "MIT"),
    "phyphox_measurements": ("https://github.com/emmermarcell/phyphox_measurements", "aeb30fac04d36196c0929e2e4ec58a14edc3484e", "none stated"),
    "phyphox-sensor-analysis": ("https://github.com/TiagoFelice/phyphox-sensor-analysis", "63e1e4f726337501e3ace170841599979db79cfa",
                                "none stated"),
    "st-mems-machine-learning-core": ("https://github.com/STMicroelectronics/st-mems-machine-learning-core",
                                      "032786702a88cc0c972c3d97c7602fc3d5793e1d", "BSD-3-Clause"),
    "agcounts": ("https://github.com/actigraph/agcounts", "b4539ac0d4d5775cb1fbe8c264cc14267cf6512e", "GPL-3.0"),
    "OpenBCI_GUI": ("https://github.com/OpenBCI/OpenBCI_GUI", "41610b98e6ac0ebc731d278d99813fd6cc9f8c81", "MIT"),
    "opensignalsreader": ("https://github.com/PGomes92/opensignalsreader", "12f95f776762384a9c28de5495d54229c002d91c", "MIT"),
    "pyshimmer": ("https://github.com/seemoo-lab/pyshimmer", "a2ef575861b4c6c83cfc28807cf300fc603b1275", "GPL-3.0"),
    "siglent_utils": ("https://github.com/evanmoring/siglent_utils", "58fbf35f7c05deb6c6516c233f27269de8813a02", "none stated"),
    "Scope_plot": ("https://github.com/HCui91/Scope_plot", "d994896ae2820ea714c76f057f8a5ad4716e5123", "MIT"),
    "magnetic-field": ("https://github.com/vicdlp/magnetic-field", "1c1e806a4c2dcdbf58f7d331a21a19f7dd6679a2", "none stated"),
    "ECE425L_PWM": ("https://github.com/AdrianSolo/ECE425L_PWM", "133d27ec15d677f9ef71070a5db047a8a19ecad2", "none stated"),
    "labopamp": ("https://github.com/muellvin/labopamp", "aa1137efede56f5dc2a07467cfb6f83e48e3220a", "none stated"),
    "datasets_mackenzie": ("https://github.com/profdanielrsousa/datasets_mackenzie", "d78ef13be2852339c373ff7cc44090d5c1a049b6", "MIT"),
    "Simple_Fourrier_Series": ("https://github.com/Mehmet5353/Simple_Fourrier_Series", "d637e01a904cf824ddb6818b830cb6b80ce70578", "none stated"),
    "FP_SS25": ("https://github.com/AignerZar/FP_SS25", "8fff097e1ca739007240581cf49063955acd9205", "none stated"),
    "PhyPraKit": ("https://github.com/GuenterQuast/PhyPraKit", "d9b1d59e2ad997ee07a3a4cc7fcca5dcf0506118", "GPL-3.0"),
    "KUHospital": ("https://github.com/tommasoisi/KUHospital", "ea76537da155488bebffe66620358daf4658837a", "none stated"),
    "helium_source_velocity": ("https://github.com/brycehenson/helium_source_velocity", "4f35117142904ee4293fbb7a474e06b83993911a", "GPL-2.0"),
    "yadg": ("https://github.com/dgbowl/yadg", "61d55fe1fcf6cdd165b09a17ca99e261e1e34f50", "GPL-3.0"),
    "impedance.py": ("https://github.com/ECSHackWeek/impedance.py", "0b302ca9eabf403bd1a1a2b2578fe2cb7f00ec2f", "MIT"),
    "cellpy": ("https://github.com/jepegit/cellpy", "c5d74b99b143db5a655b1ca7fac0dcb10f4300d7", "MIT"),
    "flirt": ("https://github.com/im-ethz/flirt", "d9bdcc56107edaa3457db5428b32fbe2080778d0", "MIT"),
    "twanger": ("https://github.com/josephmlevine/twanger", "06942c9e6663b5c31d5ef311cb4279e5f68f2527", "none stated"),
    "lightr": ("https://github.com/ropensci/lightr", "78bd9354809fc2d1f6ab97a3d4261c77ff86b65c", "GPL-2.0"),
}
table, paths = [], {}


def take(source, path, name=None):
    """The file from the commit of the clone that SOURCES names."""
    raw = subprocess.run(["git", "-C", os.path.join(CLONES, source), "show", f"{SOURCES[source][1]}:{path}"], check=True,
                         capture_output=True).stdout
    if path.endswith(".gz"):
        raw = gzip.decompress(raw)
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
    lines = [line.strip().rstrip(separator).strip().replace('"', "") for line in lines if line.strip()]
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
    expect(source, file, instrument, {column.strip('"').split(" (")[0] + "*": values for column, values in zip(head, numbers(raw, 1))})


named_csv("Fusion", "Examples/Python/sensor_data.csv", "x-io x-IMU3", "x_imu3.csv")
for walk in ["spiralStairs", "stairsAndCorridor", "straightLine"]:
    named_csv("Gait-Tracking-With-x-IMU", f"Gait Tracking With x-IMU/Datasets/{walk}_CalInertialAndMag.csv", "x-io x-IMU", f"{walk}.csv")
for unit in ["Blue - 0029D0B4", "Green - 0029C1DA", "Red - 0029B94A"]:
    for kind in ["sensors", "quaternion", "battery", "humidity", "temperature"]:
        named_csv("NGIMU", f"My Session/NGIMU-{unit}/{kind}.csv", "x-io NGIMU", f"ngimu_{unit[-8:]}_{kind}.csv")
# ---- Keysight 53230A: comments, and a column of numbers, by NumPy -----------------------------------------------------------------
for path, column in [("Keysight53230A_ti_noise_floor/tic_phase.txt", "phase_s"), ("ocxo/ocxo_frequency.txt", "frequency_Hz")]:
    file, raw = take("allantools", f"tests/{path}")
    values = np.loadtxt(raw.decode("utf-8").splitlines())
    expect("allantools", file, "Keysight 53230A", {column: values}, [["columns", column]])

# ---- Tables below some lines, by NumPy: the columns of these numbers, a name with `*` up to its unit ------------------------------
def table_of(source, path, instrument, name, skip, columns, separator=",", decimal=".", hints=(), times=None):
    """The columns of a text below so many lines; `times` are added where the lines before say a clock."""
    file, raw = take(source, path, name)
    data = numbers(raw, skip, separator, decimal)
    found = {column: data[place] for place, column in columns.items()}
    if times is not None:
        found = {"time_s": times(len(data[0])), **found}
    expect(source, file, instrument, found, hints)


def in_order(names):
    return dict(enumerate(names))


def without_names(names):
    return {"columns": in_order(names), "hints": [["columns", *names]]}


xsens = [f"{kind}_{axis}*" for kind in ["Acc", "Gyr", "Mag"] for axis in "XYZ"]
for name, rate in [("data_xsens", 50.0), ("data_xsens2", 120.0)]:
    table_of("scikit-kinematics", f"tests/data/{name}.txt", "Xsens MT Manager", f"{name}.txt", 5, in_order(["Counter*", *xsens]), "\t",
             times=lambda rows, rate=rate: [k * (1.0 / rate) for k in range(rows)])
table_of("scikit-kinematics", "tests/data/data_polulu.txt", "Pololu MinIMU", "polulu.txt", 0, separator=None,
         **without_names([f"c{k}" for k in range(11)]))
table_of("scikit-kinematics", "tests/data/data_yei.txt", "YEI 3-Space", "yei.txt", 1, **without_names([f"c{k}" for k in range(10)]))
named_csv("scikit-kinematics", "tests/data/data_xio3/Inertial.csv", "x-io x-IMU3", "x_imu3_inertial.csv")
table_of("pyABF", "data/abfs/18702001-step.atf", "Axon pCLAMP", "axon.atf", 11,
         in_order(["Time_s", "Trace #1_pA", "Trace #1_A", "Trace #2_pA", "Trace #2_A", "Trace #3_pA", "Trace #3_A"]), "\t")
for path, names in [("2_1szabadeses150cm1", ["Time*", *(f"Linear Acceleration {axis}*" for axis in "xyz"), "Absolute acceleration*"]),
                    ("3_1Fold1halo", ["Time*", *(f"Magnetic Field {axis}*" for axis in "xyz"), "Absolute field*"])]:
    table_of("phyphox_measurements", f"meresek/{path}.csv", "phyphox on a telephone", f"phyphox_{path}.csv", 1, in_order(names), "\t")
for kind in ["Accelerometer", "Gyroscope"]:
    named_csv("phyphox-sensor-analysis", f"data/raw/low_noise/{kind}.csv", "phyphox on a telephone", f"phyphox_{kind}.csv")
for sensor, path, axis in [("LSM6DSV16X", "activity_recognition_for_mobile/lsm6dsv16x/datalogs/biking", "acc_x"),
                           ("LIS2DUX12", "activity_recognition_for_mobile/lis2dux12/datalogs/biking", "acc_x"),
                           ("IIS2DULPX", "air_blower_state_recognition/iis2dulpx/datalogs/off", "acc_x"),
                           ("ISM6HG256X", "asset_tracking/ism6hg256x/datalogs/shake", "accX")]:
    table_of("st-mems-machine-learning-core", f"examples/{path}.csv", f"STMicroelectronics {sensor}", f"st_{sensor}.csv", 1,
             in_order([f"{axis}*", axis.translate(str.maketrans("xX", "yY")) + "*", axis.translate(str.maketrans("xX", "zZ")) + "*"]))
for epoch in [10, 30]:
    name = f"raw_{epoch}_30_counts{epoch}sec.csv"
    table_of("agcounts", f"data/ActiLifeCounts/{name}", "ActiGraph GT3X+", name, 11, in_order(["Axis1", "Axis2", "Axis3"]))
table_of("OpenBCI_GUI", "OpenBCI_GUI/data/EEG_Sample_Data/OpenBCI_GUI-v6-blinks-jawClench-alpha.txt", "OpenBCI Cyton", "openbci.txt", 5,
         in_order(["Sample Index", *(f"EXG Channel {k}" for k in range(8)), *(f"Accel Channel {k}" for k in range(3))]))
table_of("opensignalsreader", "opensignalsreader/files/SampleECG.txt", "BITalino", "opensignals.txt", 3, separator="\t",
         **without_names(["nSeq", "I1", "I2", "O1", "O2", "A2"]))
shimmer = [f"Shimmer_952D_{kind}_{axis}_CAL*" for kind in ["Accel_LN", "Accel_WR"] for axis in "XYZ"]
for name, separator, columns in [
    ("ecg_calibrated", "\t", ["TEST_Timestamp_Unix_CAL_ms", "TEST_EMG_CH1_24BIT_CAL_mV", "TEST_EMG_CH2_24BIT_CAL_mV"]),
    ("triaxcal_calibrated", ",", ["Shimmer_952D_Timestamp_Unix_CAL_ms", *shimmer, "Shimmer_952D_Battery_CAL_mV"]),
]:
    table_of("pyshimmer", f"test/reader/resources/{name}.csv.gz", "Shimmer3", f"shimmer_{name}.csv", 3, in_order(columns), separator)
table_of("siglent_utils", "SDS00001.csv", "Siglent SDS1202X-E", "siglent.csv", 12, in_order(["time_s", "CH1_V"]))
for source, path, channels in [("Scope_plot", "scope_0", "12"), ("Scope_plot", "scope_1", "1"), ("magnetic-field", "scope_0", "124")]:
    table_of(source, f"{path}.csv", "Keysight InfiniiVision", f"keysight_{source}_{path}.csv", 2,
             in_order(["time_s", *(f"channel_{channel}_V" for channel in channels)]))
for source, path, instrument in [("ECE425L_PWM", "ALL0000/F0000CH1", "Tektronix TDS2014C"), ("ECE425L_PWM", "ALL0003/F0003CH1", "Tektronix TDS2014C"),
                                 ("labopamp", "damping/ALL0000/F0000CH1", "Tektronix TBS1022"), ("labopamp", "damping/ALL0000/F0000CH2", "Tektronix TBS1022")]:
    channel = path[-3:]
    table_of(source, f"{path}.CSV", instrument, f"{source}_{os.path.basename(path)}.csv", 0, {3: "time_s", 4: f"{channel}_V"})
table_of("datasets_mackenzie", "T0000.CSV", "Tektronix MSO2014", "tek_mso2014.csv", 16, in_order(["TIME_s", "CH1_V", "CH1 Peak Detect*"]))
for name in ["DS0001", "DS00010"]:
    table_of("Simple_Fourrier_Series", f"{name}.CSV", "GW Instek, 25 000 points", f"gw_instek_{name}.csv", 16, in_order(["time_s", "CH1_V"]))
for name in ["T20_I20", "T25_I35"]:
    table_of("FP_SS25", f"Exp-D/data/{name}.CSV", "Rohde & Schwarz HMO", f"rs_hmo_{name}.csv", 1, in_order(["time_s", "CH2_V"]))
for name, separator, columns in [
    ("Wellenform.csv", ",", ["Time_ms", "Channel A_V"]),
    ("Hysterese.csv", ",", ["Frequency_ms", "Channel A_V", "Channel B_V"]),
    ("PicoScopeData.txt", "\t", ["Frequenz_ms", "Kanal A_V", "Kanal B_V"]),
]:
    table_of("PhyPraKit", f"examples/{name}", "PicoScope", name, 3, in_order(columns), separator)
for k in range(3):
    table_of("KUHospital", f"C2Trace0000{k}.txt", "LeCroy WaveRunner 640Zi", f"lecroy_{k}.txt", 5, in_order(["Time_s", "Ampl"]), "\t")
file, raw = take("helium_source_velocity", "data/NewFile1.csv", "DS1104Z.csv")
start, step = [float(cell) for cell in raw.decode().splitlines()[1].split(",")[2:4]]
data = numbers(raw, 2)
expect("helium_source_velocity", file, "Rigol DS1104Z",
       {"time_s": [start + k * step for k in range(len(data[0]))], "CH2_V": data[0], "CH4_V": data[1]})
table_of("yadg", "tests/test_x_basic_csv/picolog_temperature.csv", "Pico TC-08", "picolog.csv", 1,
         in_order(["", "Outside Last_C", "Outside Ave._C", "Outside Min._C", "Outside Max._C"]))
table_of("yadg", "tests/test_x_basic_csv/log 2021-09-17 11-26-14.140.csv", "Bronkhorst mass flow controller", "bronkhorst.csv", 1,
         {1: "MFC1 Measure*", 2: "MFC1 Setpoint*", 3: "MFC3 Measure*", 4: "MFC3 Setpoint*"})
table_of("yadg", "tests/test_x_drycal_csv/20211011_DryCal_out.csv", "MesaLabs Defender 530+", "drycal.csv", 4,
         {0: "Sample", 1: "DryCal smL*", 2: "DryCal Avg*", 3: "Temp*", 4: "Pressure*"})
table_of("yadg", "tests/test_x_panalytical_csv/210520step1_30min.csv", "PANalytical diffractometer", "panalytical.csv", 27,
         in_order(["Angle", "Intensity"]))
for path, skip, decimal, columns in [("ocv", 53, ".", {2: "time_s", 3: "Ewe_V"}), ("ca.issue_149", 72, ",", {7: "time_s", 8: "control_V", 9: "Ewe_V"})]:
    table_of("yadg", f"tests/test_x_eclab/{path}.mpt", "BioLogic EC-Lab", f"{path}.mpt", skip, columns, "\t", decimal)
table_of("impedance.py", "data/exampleDataParstat.txt", "Parstat", "parstat.txt", 1, {0: "Potential_V", 1: "Current_A", 2: "Elapsed Time_s"}, "\t")
table_of("impedance.py", "data/exampleDataPowersuite.txt", "PowerSuite", "powersuite.txt", 1, in_order(["Frequency", "Zre", "Zimg"]), "\t")
table_of("cellpy", "examples/data/maccor_three.txt", "Maccor", "maccor.txt", 5, {0: "Rec#", 1: "Cyc#", 2: "Step", 5: "mAmp-hr", 8: "Volts"}, "\t")
table_of("cellpy", "testdata/data/neware_uio.csv", "Neware", "neware.csv", 1, {0: "DataPoint", 1: "Cycle Index", 6: "Current_A", 7: "Voltage_V"})
for kind, names in [("ACC", ["x", "y", "z"]), ("EDA", ["eda"])]:
    table_of("flirt", f"test/wearable-data/empatica/{kind}.csv", "Empatica E4", f"e4_{kind}.csv", 2, in_order(names),
             hints=[["columns", *names], ["first_row_line", "3"]])
table_of("flirt", "test/wearable-data/garmin/acc.csv", "Garmin watch", "garmin.csv", 0, {1: "x", 2: "y", 3: "z"}, ";",
         hints=[["columns", "time", "x", "y", "z"]])
table_of("twanger", "data/data.lvm", "LabVIEW", "twanger.lvm", 23, in_order(["time_s", "Voltage_0*"]), "\t")
table_of("lightr", "inst/testdata/compare/Avantes/30849.csv", "Avantes spectrometer", "avantes.csv", 0,
         **without_names(["wavelength_nm", "counts"]))

print("| instrument | repository (licence) | commit | path | columns | rows | outcome |\n|---|---|---|---|---|---|---|")
for instrument, source, name, columns, rows, outcome in table:
    address, commit, licence = SOURCES[source]
    print(f"| {instrument} | {address.removeprefix('https://github.com/')} ({licence}) | {commit[:10]} | {paths[name]} | {columns} | {rows} | {outcome} |")
print(len(table), "files of", len({instrument for instrument, *_ in table}), "instruments and programs")
