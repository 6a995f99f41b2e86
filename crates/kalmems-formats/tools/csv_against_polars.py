"""Reads one CSV file with this crate and with polars on one core, in turns, and prints the ratio of the times.

    cargo build --release -p kalmems-formats --example read_csv
    python -m venv venv && venv/bin/pip install polars
    venv/bin/python crates/kalmems-formats/tools/csv_against_polars.py target/release/examples/read_csv FILE.csv

Without FILE.csv, files of 500 MB with 17 and with 6 digits are written to the folder of temporary files first.
This crate hashes the bytes (SHA-256) as it reads; polars does not, and is measured a second time with Python's hash after it.
"""

import math
import os
import random
import resource
import subprocess
import sys
import tempfile
import time

POLARS = """
import polars, sys
frame = polars.read_csv(sys.argv[1])
print(f"{frame.height} rows")
"""
DIGEST = """
import hashlib
print(hashlib.file_digest(open(sys.argv[1], "rb"), "sha256").hexdigest())
"""


def write(path, digits, size):
    random.seed(1)
    number = f"%.{digits}g"
    row = ",".join([number] * 3) + "\n"
    with open(path, "w") as file:
        file.write("time_s,drive_V,cap_V\n")
        written, first = 0, 0
        while written < size:
            lines = (
                row % (k * 1e-6, 90 * math.sin(0.19 * k) + random.gauss(0, 0.1), 2 + random.gauss(0, 0.01))
                for k in range(first, first + 20_000)
            )
            text = "".join(lines)
            file.write(text)
            written += len(text)
            first += 20_000


def measure(command):
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    start = time.monotonic()
    environment = dict(os.environ, POLARS_MAX_THREADS="1")
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL, env=environment)
    wall = time.monotonic() - start
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return wall, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def compare(program, path):
    def best(command):
        return tuple(min(values) for values in zip(*(measure(command) for _ in range(5))))

    empty = measure([sys.executable, "-c", "import polars"])
    ours = best([program, path])
    theirs = best([sys.executable, "-c", POLARS, path])
    hashed = best([sys.executable, "-c", POLARS + DIGEST, path])
    size = os.path.getsize(path) / 1e6
    print(f"{path}: {size:.0f} MB")
    print(f"  kalmems-formats {ours[0]:.2f} s, CPU {ours[1]:.2f} s, {size / ours[1]:.0f} MB/s of CPU time")
    print(f"  polars          {theirs[0]:.2f} s, CPU {theirs[1]:.2f} s (of it {empty[1]:.2f} s to begin)")
    print(f"  polars and hash {hashed[0]:.2f} s, CPU {hashed[1]:.2f} s")
    alone, with_hash = (ours[1] / (time[1] - empty[1]) for time in (theirs, hashed))
    print("  CPU time of kalmems-formats to that of polars without its beginning:")
    print(f"    {with_hash:.2f} where both hash, {alone:.2f} where polars does not")


def main():
    program, files = sys.argv[1], sys.argv[2:]
    if not files:
        for digits in (17, 6):
            path = os.path.join(tempfile.gettempdir(), f"kalmems_{digits}_digits.csv")
            write(path, digits, 500_000_000)
            files.append(path)
    for path in files:
        compare(program, path)


if __name__ == "__main__":
    main()
