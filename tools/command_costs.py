#!/usr/bin/env python3
"""Processor time of whole commands against an earlier build of the program, by turns, and writes the table of the book.

    tools/command_costs.py EARLIER ITS_EXAMPLES NOW [ROUNDS]

EARLIER and NOW are programs, ITS_EXAMPLES the folder `examples` of the earlier version, which need not know the files of today (an identification of
equations needs `parameters`, and is left out). Each round runs the earlier
program, the present one, and the present one on the device as equations (`kalmems expand`), on copies of the examples; a factor is that of one round, of
which the table has the median and the range. Processor time is that of all threads, from the beginning of a process to its end, files included.
"""

import pathlib
import resource
import shutil
import statistics
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent
TABLE = ROOT / "book/src/figures/command_costs.md"
COMMANDS = [
    ("estimate", "shared_scanner/experiment.toml"),
    ("estimate", "piston_mirror/experiment.toml"),
    ("estimate", "accelerometer/experiment.toml"),
    ("estimate", "micro_stage/experiment.toml"),
    # What is told of the device was as far off then as it is in this file now.
    ("estimate", "threshold_scanner/experiment.toml", "threshold_scanner/as_published.toml"),
    ("simulate", "shared_scanner/simulation.toml"),
    ("simulate", "piston_mirror/simulation.toml"),
    ("simulate", "accelerometer/simulation.toml"),
    ("simulate", "micro_stage/simulation.toml"),
    ("simulate", "threshold_scanner/simulation.toml"),
    ("identify", "shared_scanner/ring_down.toml"),
    ("identify", "accelerometer/experiment.toml"),
    ("identify", "micro_stage/experiment.toml", "micro_stage/as_published.toml"),
    ("identify", "threshold_scanner/experiment.toml", "threshold_scanner/as_published.toml"),
]


def processor_s(program, examples, command, file):
    """Seconds of a run, or nothing where it does not end well."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    out = examples / "results"
    done = subprocess.run([program, command, file, "--out", out, "--force"], cwd=examples, capture_output=True)
    shutil.rmtree(out, ignore_errors=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime if done.returncode == 0 else None


def factor(times, earlier):
    """The median and the range of what each round took of the earlier program."""
    ratios = sorted(time / other for time, other in zip(times, earlier) if time is not None)
    return f"{statistics.median(ratios):.2f} ({ratios[0]:.2f}–{ratios[-1]:.2f})" if len(ratios) == len(earlier) else "–"


def main():
    earlier, its_examples, now = sys.argv[1:4]
    rounds = int(sys.argv[4]) if len(sys.argv) > 4 else 5
    earlier, now = str(pathlib.Path(earlier).resolve()), str(pathlib.Path(now).resolve())
    lines = ["| command | earlier (s) | now | as equations |", "|---|--:|--:|--:|"]
    with tempfile.TemporaryDirectory() as folder:
        before, after = pathlib.Path(folder) / "earlier", pathlib.Path(folder) / "now"
        shutil.copytree(its_examples, before)
        shutil.copytree(ROOT / "examples", after)
        for command, its_file, *renamed in COMMANDS:
            file = renamed[0] if renamed else its_file
            text = file.replace(".toml", "_as_equations.toml")
            subprocess.run([now, "expand", file, "--write", text, "--force"], cwd=after, capture_output=True)
            runs = [(earlier, before, its_file), (now, after, file), (now, after, text)]
            times = list(zip(*([processor_s(program, examples, command, which) for program, examples, which in runs] for _ in range(rounds))))
            if None in times[0]:
                lines.append(f"| `{command} {file}` | did not end well | | |")
            else:
                lines.append(f"| `{command} {file}` | {statistics.median(times[0]):.2f} | {factor(times[1], times[0])} | {factor(times[2], times[0])} |")
            print(lines[-1], flush=True)
    TABLE.write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
