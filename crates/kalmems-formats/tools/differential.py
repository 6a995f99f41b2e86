"""Writes two hundred files with h5py, SciPy, npTDMS, pyarrow, pandas, NumPy and soundfile, and beside each what the same tool
reads from it, bit by bit, for tests/differential.rs. Into 60 of them a fault is put: a bit is turned, the end is cut off, lengths are swapped.

    python -m venv venv && venv/bin/pip install numpy scipy h5py npTDMS pyarrow pandas soundfile
    venv/bin/python crates/kalmems-formats/tools/differential.py FOLDER

NAME.expected has a line for each column, with its name and its values behind tabs: sixteen digits are the bits of a number
of 64 bits, `nan` and `missing` are none, and what begins with an apostrophe is a text. Lines before them say what an
experiment must say: `group` and `columns`. A line `fault` says that the file is damaged: what is read of it, if anything, must be what the
tool reads of the damaged file, or what was in it before if the tool refuses it.
"""

import ctypes
import decimal
import os
import struct
import sys
import warnings

import h5py
import nptdms
import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import scipy.io
import scipy.io.wavfile
import soundfile
from nptdms import ChannelObject, GroupObject, RootObject, TdmsFile, TdmsWriter

warnings.simplefilter("ignore")
FOLDER = sys.argv[1]
os.makedirs(FOLDER, exist_ok=True)
random = np.random.Generator(np.random.PCG64(7))
ROWS = 200
count = 0


def cell(value):
    if value is None or value is pd.NA or value is np.ma.masked:
        return "missing"
    if isinstance(value, (bytes, np.bytes_)):
        return "'" + value.decode("utf-8").strip()
    if isinstance(value, str):
        return "'" + value.strip()
    # One rounding of a whole number, as a division or a conversion of Python does it.
    number = float(value.item() if hasattr(value, "item") else value)
    if number != number:
        return "nan"
    return struct.pack(">d", number).hex()


WRITTEN = {}


def expect(name, columns, group=None, names=None, fault=None):
    global count
    count += 1
    WRITTEN[name] = (columns, group, names)
    with open(os.path.join(FOLDER, name + ".expected"), "w", encoding="utf-8", newline="\n") as file:
        if fault:
            file.write(f"fault\t{fault}\n")
        if group:
            file.write(f"group\t{group}\n")
        if names:
            file.write("columns\t" + "\t".join(names) + "\n")
        for column, values in columns.items():
            file.write("column\t" + "\t".join([column] + [cell(v) for v in values]) + "\n")


def path(name):
    return os.path.join(FOLDER, name)


def numbers(dtype="<f8", rows=ROWS):
    """Values over the range of a type."""
    dtype = np.dtype(dtype)
    if dtype.kind == "f":
        small = {2: 4, 4: 30, 8: 290}[dtype.itemsize]
        values = random.normal(0.0, 1.0, rows) * 10.0 ** random.integers(-small, small, rows)
        return values.astype(dtype)
    if dtype.kind == "b":
        return random.integers(0, 2, rows).astype(bool)
    limits = np.iinfo(dtype)
    return random.integers(limits.min, limits.max, rows, dtype=dtype.newbyteorder("="), endpoint=True).astype(dtype)


# ---- HDF5 by h5py --------------------------------------------------------------------------------------------------
TYPES = ["<f8", ">f8", "<f4", ">f4", "<f2", ">f2", "i1", "u1", "<i2", ">i2", "<u2", ">u2", "<i4", ">i4", "<u4", ">u4",
         "<i8", ">i8", "<u8", ">u8", "?"]


def h5(name, fill, read, group=None, names=None, **options):
    with h5py.File(path(name), "w", **options) as file:
        fill(file)
    with h5py.File(path(name), "r") as file:
        expect(name, {key: values for key, values in read(file).items()}, group, names)


def every_type(**storage):
    def fill(file):
        for number, dtype in enumerate(TYPES):
            file.create_dataset(f"c{number:02}", data=numbers(dtype), **storage)
    return fill


def flat(file):
    return {key: item[()].ravel() for key, item in file.items()}


for libver in ["earliest", ("v108", "v108"), ("v110", "v110"), ("v112", "v112"), ("v114", "v114"), "latest"]:
    word = libver if isinstance(libver, str) else libver[0]
    h5(f"types_{word}.h5", every_type(), flat, libver=libver)
    h5(f"chunked_{word}.h5", every_type(chunks=(37,)), flat, libver=libver)
    h5(f"packed_{word}.h5", every_type(chunks=(64,), compression="gzip", shuffle=True, fletcher32=True), flat,
       libver=libver)
    h5(f"growing_{word}.h5", every_type(chunks=(16,), maxshape=(None,), compression="lzf"), flat, libver=libver)

    def both(file):
        data = numbers(rows=450 * 3).reshape(450, 3)
        grown = file.create_dataset("run", shape=(0, 0), maxshape=(None, None), chunks=(7, 2), dtype="f8")
        for rows in range(50, 451, 50):
            grown.resize((rows, 3))
            grown[rows - 50:rows] = data[rows - 50:rows]
        grown.attrs["columns"] = ["a", "b", "c"]
    h5(f"both_{word}.h5", both, lambda f: dict(zip("abc", f["run"][()].T)), libver=libver)

    def wide(file):
        for name, maxshape in [("second", (60, None)), ("first", (None, 5)), ("fixed", (90, 7))]:
            data = numbers(rows=300).reshape(60, 5)
            dataset = file.create_dataset(name, data=data, maxshape=maxshape, chunks=(4, 2), compression="gzip")
        file["t"] = numbers(rows=60)
    h5(f"wide_{word}.h5", wide, lambda f: {
        "t": f["t"][()],
        **{f"{name}[:,{k}]": f[name][:, k] for name in ["first", "second", "fixed"] for k in range(5)},
    }, libver=libver)


def many_chunks(libver, rows=6000, chunk=1, maxshape=(None,), **options):
    def fill(file):
        file.create_dataset("x", data=numbers(rows=rows), chunks=(chunk,), maxshape=maxshape, **options)
    return fill, {"libver": libver}


for word, fill, options in [
    ("extensible_pages", *many_chunks("latest")),
    ("extensible_packed", *many_chunks("latest", 40_000, 16, compression="gzip")),
    ("fixed_pages", *many_chunks("latest", 6000, 1, None)),
    ("fixed_packed", *many_chunks(("v114", "v114"), 6000, 2, (9000,), compression="gzip")),
    ("old_tree", *many_chunks("earliest", 6000, 1)),
    ("single", *many_chunks("latest", 300, 300, None)),
    ("single_packed", *many_chunks(("v114", "v114"), 300, 300, None, compression="gzip", shuffle=True)),
]:
    h5(f"{word}.h5", fill, flat, **options)


def tree_of_chunks(file):
    data = numbers(rows=4000 * 2).reshape(4000, 2)
    file.create_dataset("run", data=data, chunks=(2, 1), maxshape=(None, None), compression="gzip")
    file["run"].attrs["names"] = ["p", "q"]


h5("deep_tree.h5", tree_of_chunks, lambda f: dict(zip("pq", f["run"][()].T)), libver="latest")


def library():
    folder = os.path.join(os.path.dirname(os.path.dirname(h5py.__file__)), "h5py.libs")
    names = [name for name in os.listdir(folder) if name.startswith("libhdf5-")]
    return ctypes.CDLL(os.path.join(folder, names[0]))


def refuse(name, words):
    """A file that is whole and is refused, with these words in what is said."""
    global count
    count += 1
    with open(path(name) + ".expected", "w", encoding="utf-8", newline="\n") as file:
        file.write(f"refused\t{words}\n")


def low_level(name, layout, early=False, edges=False):
    """Layouts that h5py's high level does not offer: compact, and two that are refused: one after the other, edges that are not packed."""
    data = numbers(rows=250)
    with h5py.File(path(name), "w", libver="latest") as file:
        properties = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
        if layout == "compact":
            properties.set_layout(h5py.h5d.COMPACT)
        else:
            properties.set_chunk((40,))
        if early:
            properties.set_alloc_time(h5py.h5d.ALLOC_TIME_EARLY)
        if edges:
            properties.set_deflate(4)
            # H5D_CHUNK_DONT_FILTER_PARTIAL_CHUNKS, which h5py does not offer: in the library that it brings.
            assert library().H5Pset_chunk_opts(ctypes.c_int64(properties.id), ctypes.c_uint(2)) == 0
        space = h5py.h5s.create_simple((250,))
        dataset = h5py.h5d.create(file.id, b"x", h5py.h5t.IEEE_F64LE, space, properties)
        dataset.write(h5py.h5s.ALL, h5py.h5s.ALL, data)
    if early or edges:
        refuse(name, "write its values into a new file with h5py")
        return
    with h5py.File(path(name), "r") as file:
        expect(name, flat(file))


low_level("compact.h5", "compact")
low_level("implicit.h5", "chunked", early=True)
low_level("edges.h5", "chunked", edges=True)


def netcdf(file):
    raw = numbers("<i2")
    raw[7] = raw[80] = -32768
    packed = file.create_dataset("p", data=raw)
    packed.attrs["scale_factor"], packed.attrs["add_offset"] = 2.5e-4, -0.75
    packed.attrs["_FillValue"] = np.int16(-32768)
    packed.attrs["units"] = "Volts"
    wide = numbers("<i8")
    wide[3] = 2**62 + 1
    file.create_dataset("q", data=wide).attrs["missing_value"] = np.int64([2**62 + 1])
    single = numbers("<f4")
    single[11] = np.float32(1e20)
    file.create_dataset("r", data=single).attrs["_FillValue"] = np.float32(1e20)
    bytes_ = numbers("i1")
    file.create_dataset("u", data=bytes_).attrs["_Unsigned"] = "true"


def read_netcdf(file):
    p, q, r, u = (file[key][()] for key in "pqru")
    scaled = [None if v == -32768 else float(v) * 2.5e-4 + -0.75 for v in p]
    return {"p*": scaled, "q": [None if v == 2**62 + 1 else v for v in q],
            "r": [None if v == np.float32(1e20) else v for v in r], "u": u.view("u1")}


for libver in ["earliest", "latest"]:
    h5(f"netcdf_{libver}.h5", netcdf, read_netcdf, libver=libver)


def linked(file):
    rig = file.create_group("data/rig/run")
    rig["a"], rig["b"] = numbers(), numbers("<i4")
    rig["soft"] = h5py.SoftLink("/data/rig/run/a")
    rig["relative"] = h5py.SoftLink("b")
    rig["hard"] = rig["b"]
    rig["out"] = h5py.ExternalLink("outside.h5", "/far/away")
    rig["broken"] = h5py.SoftLink("/nowhere")
    rig["gone"] = h5py.ExternalLink("gone.h5", "/x")
    rig["up"] = file["/"]
    rig["above"] = h5py.SoftLink("/data")
    rig["circle"] = h5py.SoftLink("circle")
    file["alias"] = h5py.SoftLink("/data/rig")
    rig["words"] = np.array(["ab", "c"] * (ROWS // 2), dtype="S4")


with h5py.File(path("outside.h5"), "w") as outside:
    outside["far/away"] = numbers(rows=ROWS)
with h5py.File(path("outside.h5"), "r") as outside:
    expect("outside.h5", {"away": outside["far/away"][()]})
for libver in ["earliest", "latest"]:
    h5(f"links_{libver}.h5", linked, lambda f: {
        key: f["data/rig/run"][key][()] for key in ["a", "b", "soft", "relative", "hard", "out", "words"]
    }, libver=libver)
    h5(f"alias_{libver}.h5", linked, lambda f: {key: f["alias/run"][key][()] for key in ["a", "soft", "b"]},
       group="/alias/run", libver=libver)


def large_group(file):
    for number in range(300):
        file[f"column_{number:03}_with_a_name_that_is_not_short"] = numbers(rows=12)
        file[f"column_{number:03}_with_a_name_that_is_not_short"].attrs["units"] = "V"


for libver in ["earliest", "latest"]:
    h5(f"large_group_{libver}.h5", large_group, lambda f: {key + "_V": item[()] for key, item in f.items()},
       libver=libver)


def many_attributes(file):
    x = file.create_dataset("x", data=numbers("<i2"))
    for number in range(40):
        x.attrs[f"note {number}"] = "n" * number
    x.attrs["scale_factor"] = np.float64([0.125])


for libver in ["earliest", "latest"]:
    h5(f"many_attributes_{libver}.h5", many_attributes, lambda f: {"x": f["x"][()].astype("f8") * 0.125}, libver=libver)


def records(file):
    dtype = np.dtype([("a", "<f8"), ("b", ">i4"), ("c", "S5"), ("d", "<f4"), ("e", "<u2")])
    rows = np.zeros(ROWS, dtype=dtype)
    for name in "abde":
        rows[name] = numbers(dtype[name])
    rows["c"] = [b"left" if k % 3 else b"right" for k in range(ROWS)]
    file.create_dataset("table", data=rows, chunks=(33,), compression="gzip")


for libver in ["earliest", "latest"]:
    h5(f"records_{libver}.h5", records, lambda f: {name: f["table"][name] for name in "abcde"}, libver=libver)


def texts(file):
    words = ["", "rise", "längs", "µ"] * 50
    file.create_dataset("w", data=words, dtype=h5py.string_dtype(), chunks=(30,))
    file.create_dataset("s", data=np.array([w.encode() for w in words]))
    file["x"] = numbers()


for libver in ["earliest", "latest"]:
    h5(f"texts_{libver}.h5", texts, lambda f: {"w": f["w"].asstr()[()], "s": f["s"][()], "x": f["x"][()]}, libver=libver)
h5("userblock.h5", every_type(), flat, userblock_size=2048)

# ---- MAT by SciPy --------------------------------------------------------------------------------------------------
MAT_TYPES = [t for t in TYPES if t[0] != ">" and t not in ("<f2",)]


def mat(name, variables, column=None, **options):
    scipy.io.savemat(path(name), variables, **options)
    read = scipy.io.loadmat(path(name), squeeze_me=True, struct_as_record=False)
    return {key: value for key, value in read.items() if not key.startswith("__")}


for way in ["row", "column"]:
    for packed in [False, True]:
        name = f"mat5_{way}_{'packed' if packed else 'plain'}.mat"
        expect(name, mat(name, {f"c{n:02}": numbers(t) for n, t in enumerate(MAT_TYPES)}, oned_as=way,
                         do_compression=packed))
    name = f"mat4_{way}.mat"
    four = {f"c{n:02}": numbers(t) for n, t in enumerate(["<f8", "<f4", "<i4", "<i2", "<u2", "u1"])}
    expect(name, mat(name, four, format="4", oned_as=way))
name = "mat4_matrix.mat"
read = mat(name, {"run": numbers(rows=600).reshape(200, 3)}, format="4")
expect(name, dict(zip("abc", read["run"].T)), names=list("abc"))
name = "mat5_beside.mat"
read = mat(name, {"t": numbers(), "u": numbers(rows=400).reshape(200, 2)}, oned_as="row")
expect(name, {"t": read["t"], "u(:,1)": read["u"][:, 0], "u(:,2)": read["u"][:, 1]})
name = "mat5_deep_struct.mat"
read = mat(name, {"rig": {"run": {"t": numbers(), "u": numbers("<i2")}, "note": "text"}}, oned_as="column")
expect(name, {"t": read["rig"].run.t, "u": read["rig"].run.u})
name = "mat5_lengths.mat"
read = mat(name, {"t": numbers(), "u": numbers(), "slow": numbers(rows=20), "rate": 5.0})
expect(name, {"t": read["t"], "u": read["u"]})

# ---- TDMS by npTDMS ------------------------------------------------------------------------------------------------
TDMS_TYPES = [t for t in TYPES if t[0] != ">" and t not in ("<f2",)]


def tdms(name, segments, columns=None, **options):
    with TdmsWriter(path(name), **options) as writer:
        for segment in segments:
            writer.write_segment(segment)
    with TdmsFile.open(path(name)) as file:
        group = file.groups()[0]
        read = {c.name: c[:] for c in group.channels()}
        return read, group


for version in [4712, 4713]:
    for segments in [1, 3]:
        name = f"types_{version}_{segments}.tdms"
        read, _ = tdms(name, [
            [ChannelObject("g", f"c{n:02}", numbers(t, 60)) for n, t in enumerate(TDMS_TYPES)] for _ in range(segments)
        ], version=version)
        expect(name, read)
name = "units.tdms"
read, _ = tdms(name, [[
    ChannelObject("g", "drive", numbers(), properties={"unit_string": "V"}),
    ChannelObject("g", "cap", numbers("<f4"), properties={"NI_UnitDescription": "pF"}),
    ChannelObject("g", "words", ["a", "bc"] * 100),
]])
expect(name, {"drive_V": read["drive"], "cap_pF": read["cap"], "words": read["words"]})


def linear(number, slope, offset, source):
    return {f"NI_Scale[{number}]_Scale_Type": "Linear", f"NI_Scale[{number}]_Linear_Slope": slope,
            f"NI_Scale[{number}]_Linear_Y_Intercept": offset,
            f"NI_Scale[{number}]_Linear_Input_Source": nptdms.types.Uint32(source)}


def polynomial(number, coefficients, source):
    prefix = f"NI_Scale[{number}]_Polynomial_"
    return {f"NI_Scale[{number}]_Scale_Type": "Polynomial",
            prefix + "Coefficients_Size": nptdms.types.Uint32(len(coefficients)),
            prefix + "Input_Source": nptdms.types.Uint32(source),
            **{prefix + f"Coefficients[{k}]": c for k, c in enumerate(coefficients)}}


def table(number, before, after, source):
    prefix = f"NI_Scale[{number}]_Table_"
    made = {f"NI_Scale[{number}]_Scale_Type": "Table", prefix + "Input_Source": nptdms.types.Uint32(source)}
    for word, values in [("Pre_Scaled_Values", before), ("Scaled_Values", after)]:
        made[prefix + word + "_Size"] = nptdms.types.Uint32(len(values))
        made |= {prefix + f"{word}[{k}]": float(v) for k, v in enumerate(values)}
    return made


RAW = 0xFFFFFFFF
for name, dtype, scales, properties in [
    ("linear", "<i2", 1, linear(0, 3.0517578125e-4, 0.01, RAW)),
    ("polynomial", "<i2", 1, polynomial(0, [0.1, 3.05e-4, -2e-12, 1e-18], RAW)),
    ("table", "<f8", 1, table(0, [-10.0, -1.0, 0.0, 2.0, 9.0], [5.0, 4.0, 3.5, 3.0, -1.0], RAW)),
    ("falling_table", "<i2", 1, table(0, [30000, 10, -30000], [1.0, 2.0, 3.0], RAW)),
    ("chain", "<i2", 3, linear(0, 3e-4, 0.02, RAW) | polynomial(1, [0.5, 2.0, 0.25], 0) | linear(2, -7.5, 1.0, 1)),
    ("scaled_already", "<f8", 1, linear(0, 3.0, 1.0, RAW) | {"NI_Scaling_Status": "scaled"}),
]:
    data = numbers(dtype) if dtype != "<f8" else random.uniform(-15.0, 15.0, ROWS)
    read, _ = tdms(f"scale_{name}.tdms", [[ChannelObject("g", "x", data, properties={
        "NI_Number_Of_Scales": nptdms.types.Uint32(scales), "NI_Scaling_Status": "unscaled"} | properties)]])
    expect(f"scale_{name}.tdms", read)
name = "scale_of_group.tdms"
read, _ = tdms(name, [[GroupObject("g", properties={"NI_Number_Of_Scales": nptdms.types.Uint32(1)}
                                   | linear(0, 0.5, 2.0, RAW)), ChannelObject("g", "x", numbers("<i4"))]])
expect(name, read)

# ---- Parquet by pyarrow and pandas -----------------------------------------------------------------------------------
PARQUET = {f"c{n:02}": numbers(t) for n, t in enumerate(t for t in TYPES if t[0] != ">")}


def parquet(name, made, **options):
    pq.write_table(made, path(name), **options)
    read = pq.read_table(path(name))
    return {column: read[column].to_pylist() for column in read.column_names}


for packing in ["none", "snappy", "gzip", "lz4", "zstd"]:
    for version in ["1.0", "2.0"]:
        name = f"parquet_{packing}_{version[0]}.parquet"
        made = pa.table({key: pa.array(values) for key, values in PARQUET.items()
                         if values.dtype != np.float16})
        expect(name, parquet(name, made, compression=packing, data_page_version=version, row_group_size=70))
name = "half.parquet"
read = parquet(name, pa.table({"x": pa.array(numbers("<f2")), "y": pa.array(numbers())}))
expect(name, read)
name = "nullable.parquet"
mask = random.random(ROWS) < 0.2
made = pa.table({"a": pa.array(numbers(), mask=mask), "b": pa.array(numbers("<i4"), mask=~mask),
                 "s": pa.array(["x", "y"] * 100), "d": pa.array(["p", "q"] * 100).dictionary_encode()})
expect(name, parquet(name, made))
for precision, scale in [(9, 4), (18, 6), (30, 10)]:
    name = f"decimal_{precision}.parquet"
    values = [decimal.Decimal(int(v)).scaleb(-scale) for v in random.integers(-10**8, 10**8, ROWS)]
    read = parquet(name, pa.table({"x": pa.array(values, pa.decimal128(precision, scale)), "y": numbers()}))
    expect(name, read)
frame = pd.DataFrame({"t": numbers(), "n": pd.array(numbers("<i4"), dtype="Int32"), "label": ["a", "b"] * 100})
frame.loc[5:9, "n"] = pd.NA
frame.to_parquet(path("pandas.parquet"))
frame = pd.read_parquet(path("pandas.parquet"))
expect("pandas.parquet", {key: list(frame[key]) for key in frame})

# ---- NumPy -----------------------------------------------------------------------------------------------------------
np.savez(path("stored.npz"), **{f"c{n:02}": numbers(t) for n, t in enumerate(TYPES)})
np.savez_compressed(path("packed.npz"), **{f"c{n:02}": numbers(t) for n, t in enumerate(TYPES)})
for name in ["stored.npz", "packed.npz"]:
    with np.load(path(name)) as read:
        expect(name, {key: read[key] for key in read})
np.savez(path("beside.npz"), t=numbers(), u=numbers(rows=400).reshape(200, 2),
         v=np.asfortranarray(numbers("<i2", 600).reshape(200, 3)), rate=5.0, slow=numbers(rows=10))
with np.load(path("beside.npz")) as read:
    expect("beside.npz", {"t": read["t"], **{f"{key}[:,{k}]": read[key][:, k] for key in "uv"
                                            for k in range(read[key].shape[1])}})
for order in "CF":
    for dtype in ["<f8", ">f4", "<f2", ">i2", "<u8"]:
        name = f"plain_{order}_{np.dtype(dtype).name}.npy"
        np.save(path(name), np.asarray(numbers(dtype, 600).reshape(200, 3), order=order))
        read = np.load(path(name))
        expect(name, dict(zip("abc", read.T)), names=list("abc"))
dtype = np.dtype([("a", ">f8"), ("b", "<f2"), ("c", "S3"), ("d", "<U2"), ("e", "?"), ("f", "<i8")], align=True)
rows = np.zeros(ROWS, dtype=dtype)
for name in "abef":
    rows[name] = numbers(dtype[name])
rows["c"], rows["d"] = [b"abc", b"de"] * 100, ["µ", "xy"] * 100
np.save(path("fields.npy"), rows)
read = np.load(path("fields.npy"))
expect("fields.npy", {name: read[name] for name in dtype.names})

# ---- WAV by SciPy ------------------------------------------------------------------------------------------------------
for dtype, full in [("u1", 128), ("<i2", 2**15), ("<i4", 2**31), ("<f4", 1), ("<f8", 1)]:
    name = f"sound_{np.dtype(dtype).name}.wav"
    data = numbers(dtype, 400) if dtype[1] != "f" else random.uniform(-1, 1, 400).astype(dtype)
    scipy.io.wavfile.write(path(name), 44_100, data.reshape(200, 2))
    rate, read = scipy.io.wavfile.read(path(name))
    middle = 128 if dtype == "u1" else 0
    columns = {f"channel{k + 1}_1": (read[:, k].astype("f8") - middle) / full for k in range(2)}
    expect(name, {"time_s": np.arange(200) / 44_100, **columns})

# ---- WAV by libsndfile -------------------------------------------------------------------------------------------------
for subtype, container in [("PCM_16", "WAV"), ("PCM_24", "WAV"), ("PCM_32", "WAV"), ("FLOAT", "WAV"), ("DOUBLE", "WAV"),
                           ("PCM_16", "RF64"), ("DOUBLE", "WAVEX")]:
    name = f"sndfile_{subtype.lower()}_{container.lower()}.wav"
    data = random.uniform(-0.9, 0.9, (150, 3))
    soundfile.write(path(name), data, 8000, subtype=subtype, format=container)
    read, _ = soundfile.read(path(name), always_2d=True)
    expect(name, {"time_s": np.arange(150) / 8000, **{f"channel{k + 1}_1": read[:, k] for k in range(3)}})

# ---- Parquet with checksums, and text by pandas ------------------------------------------------------------------------
for packing in ["none", "snappy", "gzip", "lz4", "zstd"]:
    name = f"parquet_sums_{packing}.parquet"
    made = pa.table({"t": numbers(), "u": numbers("<i4"), "v": numbers("<f4")})
    expect(name, parquet(name, made, compression=packing, write_page_checksum=True, row_group_size=90))
for name, options in [("plain", {}), ("semicolons", {"sep": ";", "decimal": ","}), ("tabs", {"sep": "\t"}),
                      ("quoted", {"quoting": 1}), ("index", {"index_label": "n"})]:
    frame = pd.DataFrame({"t_s": np.arange(ROWS) * 1e-3, "cap_V": random.normal(0, 1, ROWS), "count": np.arange(ROWS) * 7})
    if name != "index":
        options["index"] = False
    frame.to_csv(path(f"pandas_{name}.csv"), **options)
    expect(f"pandas_{name}.csv", {key: list(frame[key]) for key in frame})

# ---- Clocks that files state -------------------------------------------------------------------------------------------
for name, start_us, increment in [("whole", 5_000, 1e-3), ("same", 0, 2.5e-4), ("negative", -3_000, 1e-3)]:
    begin = np.datetime64("2026-03-01T12:00:00")
    channels = [ChannelObject("g", key, values, properties={
        "wf_start_time": begin + np.timedelta64(us, "us"), "wf_start_offset": 0.0, "wf_increment": increment})
        for key, values, us in [("a", numbers(), 0), ("b", numbers(), start_us)]]
    read, _ = tdms(f"clock_{name}.tdms", [channels])
    later = round(start_us * 1e-6 / increment)
    pad = [None] * abs(later)
    a, b = list(read["a"]), list(read["b"])
    expect(f"clock_{name}.tdms", {"a": a + pad if later > 0 else pad + a, "b": pad + b if later > 0 else b + pad})
with h5py.File(path("clock.h5"), "w") as file:
    file.create_dataset("cap", data=numbers()).attrs["fs"] = 1000.0
with h5py.File(path("clock.h5"), "r") as file:
    expect("clock.h5", {"time_s": np.arange(ROWS) / 1000.0, "cap": file["cap"][()]})
np.savez(path("clock.npz"), cap=numbers(), fs=1000.0)
with np.load(path("clock.npz")) as read:
    expect("clock.npz", {"time_s": np.arange(ROWS) / 1000.0, "cap": read["cap"]})


# ---- Faults --------------------------------------------------------------------------------------------------------------
def again(name):
    """What the tool that wrote a file reads of it, column by column."""
    columns, _, _ = WRITTEN[name]
    if name.endswith(".mat"):
        read = scipy.io.loadmat(path(name), squeeze_me=True, struct_as_record=False)
    elif name.endswith(".npz"):
        with np.load(path(name)) as file:
            read = {key: file[key] for key in file}
    elif name.endswith(".h5"):
        with h5py.File(path(name), "r") as file:
            read = {key: item[()].ravel() for key, item in file.items()}
    elif name.endswith(".parquet"):
        table = pq.read_table(path(name), page_checksum_verification=True)
        read = {key: table[key].to_pylist() for key in table.column_names}
    elif name.endswith(".tdms"):
        with TdmsFile.open(path(name)) as file:
            read = {c.name: c[:] for c in file.groups()[0].channels()}
    else:
        data, rate = soundfile.read(path(name), always_2d=True)
        read = {"time_s": np.arange(len(data)) / rate, **{f"channel{k + 1}_1": data[:, k] for k in range(data.shape[1])}}
    return {key: read[key] for key in columns}


def damage(name, number, kind, change):
    columns, group, names = WRITTEN[name]
    with open(path(name), "rb") as file:
        whole = file.read()
    stem, ending = os.path.splitext(name)
    damaged = f"fault_{number:02}_{kind}_{stem}{ending}"
    with open(path(damaged), "wb") as file:
        file.write(change(whole))
    WRITTEN[damaged] = (columns, group, names)
    try:
        read, fault = again(damaged), f"{kind}, read by its tool"
    except BaseException as error:  # whatever a tool raises
        read, fault = columns, f"{kind}, refused by its tool: {type(error).__name__}"
    expect(damaged, read, group, names, fault)


def flip(whole):
    place = int(random.integers(len(whole) // 4, len(whole)))
    return whole[:place] + bytes([whole[place] ^ (1 << int(random.integers(8)))]) + whole[place + 1:]


def cut(whole):
    return whole[:int(random.integers(len(whole) // 8, len(whole)))]


def swap(whole):
    """Two words of 32 bits that look like lengths in another's place."""
    words = [k for k in range(0, len(whole) - 4, 4) if 0 < struct.unpack("<I", whole[k:k + 4])[0] < len(whole)]
    one, other = (words[int(k)] for k in random.choice(len(words), 2, replace=False))
    swapped = bytearray(whole)
    swapped[one:one + 4], swapped[other:other + 4] = whole[other:other + 4], whole[one:one + 4]
    return bytes(swapped)


number = 0
for name in ["mat5_row_packed.mat", "mat5_column_plain.mat", "packed.npz", "stored.npz", "packed_latest.h5", "packed_earliest.h5",
             "types_latest.h5", "parquet_sums_none.parquet", "parquet_sums_zstd.parquet", "parquet_gzip_1.parquet",
             "types_4713_3.tdms", "sndfile_pcm_24_wav.wav"]:
    for kind, change in [("bit", flip), ("bit", flip), ("bit", flip), ("cut", cut), ("swap", swap)]:
        damage(name, number, kind, change)
        number += 1

print(f"{count} files")
