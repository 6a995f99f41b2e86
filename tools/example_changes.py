#!/usr/bin/env python3
"""What the examples' estimates are against an earlier build of the program, and what the integration step has to do with it, as a table of the book.

    tools/example_changes.py EARLIER ITS_EXAMPLES NOW

EARLIER and NOW are programs, ITS_EXAMPLES the folder `examples` of the earlier version. Of each filter whose error (or else mean NIS) differs by more
than 0.1 %: the figure before and now, and the root mean square of the distance between two trajectories in claimed standard deviations, of that state and
those rows of the second and third part of a recording where it is largest: from the earlier program's to that of today, and from that of today to one of 16
steps a sample.
"""

import csv
import json
import math
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent
TABLE = ROOT / "book/src/figures/example_changes.md"
FILES = [
    ("shared_scanner/experiment.toml",),
    ("shared_scanner/stiffness_state.toml",),
    ("shared_scanner/true_stiffness.toml",),
    ("piston_mirror/experiment.toml",),
    ("accelerometer/experiment.toml",),
    ("threshold_scanner/experiment.toml", "threshold_scanner/as_published.toml"),
    ("micro_stage/experiment.toml", "micro_stage/as_published.toml"),
    ("comb_resonator/experiment.toml",),
    ("tuning_fork/experiment.toml",),
    ("thermal_mirror/experiment.toml",),
    ("vibrating_gyroscope/experiment.toml",),
]


def estimate(program, examples, file, out):
    """Its answers as JSON, and the trajectories that it wrote."""
    run = [program, "estimate", file, "--out", out, "--force", "--json"]
    done = subprocess.run(run, cwd=examples, capture_output=True, text=True, check=False)
    if done.returncode not in (0, 3):
        sys.exit(f"{program} {file}: {done.stderr}")
    return json.loads(done.stdout), {path.name: columns(path) for path in sorted(out.glob("*trajectory_*.csv"))}


def columns(path):
    """The numbers of a trajectory, by the name of the column."""
    head, *rows = csv.reader(line for line in path.read_text().splitlines() if not line.startswith("#"))
    return {name: [float(row[i]) if row[i] else math.nan for row in rows] for i, name in enumerate(head)}


def distance(of, other):
    """The largest distance of a state in claimed standard deviations, with its name; none where nothing is claimed."""
    largest = (-1.0, "")
    for name, values in of.items():
        claimed = re.sub(r"_([^_]*(?:_per_[^_]*)?)$", r"_sd_\1", name)
        if name.startswith("innovation") or claimed not in of or name not in other:
            continue
        rows = list(zip(values, other[name], of[claimed]))
        off = [((x - y) / sd) ** 2 for x, y, sd in rows[len(rows) // 3 :] if sd > 0 and math.isfinite(x - y)]
        if off:
            largest = max(largest, (math.sqrt(sum(off) / len(off)), name))
    return "–" if largest[0] < 0 else f"{largest[0]:.1e}" if largest[0] < 1e-3 else f"{largest[0]:.3f}"


def figures(filter_):
    """What is compared of a filter: errors first."""
    if filter_.get("errors"):
        yield "angle, deg", filter_["errors"]["angle"]["rmse_deg"]
    for name, value in (filter_.get("values") or {}).items():
        yield f"{name}, {value['unit']}", value["rmse"]
    if filter_.get("consistency"):
        yield "mean NIS", filter_["consistency"]["mean_nis"]


def main():
    earlier, its_examples, now = (str(pathlib.Path(path).resolve()) for path in sys.argv[1:4])
    lines = ["| example | filter | of | before | now | from before to now | from now to 16 steps |", "|---|---|---|--:|--:|--:|--:|"]
    with tempfile.TemporaryDirectory() as folder:
        before, after = pathlib.Path(folder) / "earlier", pathlib.Path(folder) / "now"
        shutil.copytree(its_examples, before)
        shutil.copytree(ROOT / "examples", after)
        out = pathlib.Path(folder) / "out"
        for its_file, *renamed in FILES:
            file = renamed[0] if renamed else its_file
            stepped = file.replace(".toml", "_in_16_steps.toml")
            text = (after / file).read_text()
            (after / stepped).write_text(re.sub(r'(?m)^method = "(ekf|ukf)"$', r"\g<0>\nsteps = 16", text))
            old, its_trajectories = estimate(earlier, before, its_file, out / "before")
            new, trajectories = estimate(now, after, file, out / "now")
            in_steps = estimate(now, after, stepped, out / "steps")[1]
            segments = zip(*([segment for recording in run["recordings"] for segment in recording["segments"]] for run in (old, new)))
            for number, (was, is_) in enumerate(segments, 1):
                others = {filter_["key"]: dict(figures(filter_)) for filter_ in was["estimators"]}
                for filter_ in is_["estimators"]:
                    other = others.get(filter_["key"], {})
                    changed = [(name, other[name], value) for name, value in figures(filter_) if name in other and abs(value / other[name] - 1) > 1e-3]
                    if not changed:
                        continue
                    name, before_, value = changed[0]
                    file_name = next(key for key in trajectories if re.fullmatch(rf"(test{number}_)?trajectory_{filter_['key']}\.csv", key))
                    mine = trajectories[file_name]
                    between = [distance(mine, rest[file_name]) for rest in (its_trajectories, in_steps)]
                    place = file.removesuffix(".toml") + f", segment {number}" * (len(is_["estimators"]) < len(trajectories) / 2)
                    cells = [place, filter_["name"], name, f"{before_:.4g}", f"{value:.4g}", *between]
                    lines.append(f"| {' | '.join(cells)} |")
                    print(lines[-1], flush=True)
    TABLE.write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
