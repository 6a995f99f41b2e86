#!/usr/bin/env python3
"""Compares what two builds of the command make of every example.

    tools/compare_binaries.py OLD NEW [--keep FOLDER] [--relative 1e-12]

Each build runs the same commands over a copy of `examples/` of its own. Of every file that either writes it is told whether
the bytes are the same; of tables (CSV) and JSON, where they are not, by how much their numbers differ, relative to the
largest number of the column or key. Ends with 1 where a trajectory differs by more than `--relative`, or a command does
not end as the other does. The timing in `run.toml` and the manifest are left out.
"""

import argparse
import csv
import json
import math
import pathlib
import shutil
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent

# Commands over the examples, in an order in which each finds the results that it needs.
COMMANDS = [
    ["estimate", "shared_scanner/experiment.toml"],
    ["estimate", "shared_scanner/stiffness_state.toml"],
    ["estimate", "shared_scanner/true_stiffness.toml"],
    ["estimate", "threshold_scanner/as_published.toml"],
    ["estimate", "accelerometer/experiment.toml"],
    ["estimate", "piston_mirror/experiment.toml"],
    ["simulate", "shared_scanner/simulation.toml"],
    ["simulate", "shared_scanner/ring_down_simulation.toml"],
    ["simulate", "shared_scanner/regulate.toml"],
    ["simulate", "threshold_scanner/simulation.toml"],
    ["simulate", "accelerometer/simulation.toml"],
    ["simulate", "accelerometer/one_bit.toml"],
    ["simulate", "micro_stage/simulation.toml"],
    ["simulate", "piston_mirror/simulation.toml"],
    ["simulate", "piston_mirror/driven.toml", "--then", "estimate"],
    ["simulate", "shared_scanner/two_axes.toml", "--then", "estimate"],
    ["identify", "shared_scanner/ring_down.toml"],
    ["identify", "micro_stage/as_published.toml"],
    ["identify", "accelerometer/experiment.toml"],
    ["identify", "threshold_scanner/as_published.toml"],
    ["estimate", "micro_stage/as_published.toml"],
    ["image", "shared_scanner/image.toml"],
    ["calibrate", "gyro", "gyroscope/calibration.toml"],
    ["calibrate", "gyro", "gyroscope/three_axes.toml"],
    ["study", "shared_scanner/study.toml"],
]


def run(binary, examples, command):
    """Runs one command; its exit status and the folder of its result."""
    then = command[command.index("--then") + 1] if "--then" in command else None
    words = command[: command.index("--then")] if then else command
    name = "-".join(words).replace("/", "-").replace(".toml", "")
    out = examples / "results" / name
    words = [binary, *words, "--out", str(out)]
    status = subprocess.run(words, cwd=examples, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL).returncode
    results = [(name, status, out)]
    if then and status == 0:
        after = examples / "results" / f"{name}-{then}"
        words = [binary, then, str(out / "experiment.toml"), "--out", str(after)]
        status = subprocess.run(words, cwd=examples, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL).returncode
        results.append((f"{name}-{then}", status, after))
    return results


def without_timing(text):
    """A record of a run without the table of its timing."""
    kept, timing = [], False
    for line in text.splitlines():
        if line.startswith("["):
            timing = line.startswith("[timing")
        if not timing:
            kept.append(line)
    return "\n".join(kept)


def table(path):
    with open(path, newline="") as file:
        rows = list(csv.reader(file))
    return rows[0], rows[1:]


def number(cell):
    try:
        return float(cell)
    except ValueError:
        return None


def table_difference(old, new):
    """The largest difference of two tables, relative to the largest number of its column; infinite where they have another shape."""
    (header, a), (other, b) = table(old), table(new)
    if header != other or len(a) != len(b):
        return math.inf
    worst = 0.0
    for column in range(len(header)):
        pairs = [(row[column], other_row[column]) for row, other_row in zip(a, b) if row[column] != other_row[column]]
        if not pairs:
            continue
        numbers = [abs(n) for n in (number(row[column]) for row in a) if n is not None and math.isfinite(n)]
        size = max(numbers, default=0.0)
        for x, y in pairs:
            x, y = number(x), number(y)
            if x is None or y is None or size == 0.0:
                return math.inf
            worst = max(worst, abs(x - y) / size)
    return worst


def leaves(value, key=""):
    if isinstance(value, dict):
        for name, inner in value.items():
            yield from leaves(inner, f"{key}.{name}")
    elif isinstance(value, list):
        for place, inner in enumerate(value):
            yield from leaves(inner, f"{key}[{place}]")
    else:
        yield key, value


def json_difference(old, new):
    """The largest relative difference of the numbers of two JSON files, and the keys that are not alike."""
    a, b = (dict(leaves(json.loads(path.read_text()))) for path in (old, new))
    worst, unlike = 0.0, [key for key in a.keys() ^ b.keys()]
    for key in a.keys() & b.keys():
        x, y = a[key], b[key]
        if x == y or key.endswith("seconds_per_step"):
            continue
        if isinstance(x, (int, float)) and isinstance(y, (int, float)):
            worst = max(worst, abs(x - y) / max(abs(x), abs(y)))
        else:
            unlike.append(key)
    return worst, unlike


def compare(old, new):
    """What is not the same in two folders of a result: name, and by how much or how."""
    names = {path.relative_to(folder) for folder in (old, new) for path in folder.rglob("*") if path.is_file()}
    equal, different = 0, []
    for name in sorted(names):
        a, b = old / name, new / name
        if name.name == "manifest.toml":
            continue
        if not (a.exists() and b.exists()):
            different.append((name, "is only in the " + ("old" if a.exists() else "new") + " result", None))
        elif name.name == "run.toml":
            if without_timing(a.read_text()) == without_timing(b.read_text()):
                equal += 1
            else:
                different.append((name, "says something else", None))
        elif a.read_bytes() == b.read_bytes():
            equal += 1
        elif name.suffix == ".csv":
            worst = table_difference(a, b)
            different.append((name, f"numbers differ by at most {worst:.1e} of their column", worst))
        elif name.suffix == ".json":
            worst, unlike = json_difference(a, b)
            words = f"numbers differ by at most {worst:.1e}"
            if unlike:
                words += f"; {len(unlike)} keys differ, such as `{sorted(unlike)[0]}`"
            different.append((name, words, None))
        else:
            different.append((name, "has other bytes", None))
    return equal, different


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("old", type=pathlib.Path)
    parser.add_argument("new", type=pathlib.Path)
    parser.add_argument("--keep", type=pathlib.Path, help="where the results stay")
    parser.add_argument("--relative", type=float, default=1e-12, help="how far a trajectory may differ")
    options = parser.parse_args()
    folder = options.keep or pathlib.Path(tempfile.mkdtemp())
    failed, files = False, 0
    for which in ("old", "new"):
        shutil.copytree(ROOT / "examples", folder / which)
    for command in COMMANDS:
        sides = [
            run(binary.resolve(), folder / which, command)
            for which, binary in (("old", options.old), ("new", options.new))
        ]
        for (name, status, old), (_, other, new) in zip(*sides):
            equal, different = compare(old, new)
            files += equal
            failed |= status != other
            print(f"{name}: {equal} files with the same bytes, exit {status} and {other}", flush=True)
            for file, words, worst in different:
                print(f"    {file}: {words}", flush=True)
                failed |= worst is not None and file.name.startswith("trajectory") and worst > options.relative
        if len(sides[0]) != len(sides[1]):
            failed = True
    print(f"{files} files have the same bytes")
    if not options.keep:
        shutil.rmtree(folder)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
