"""What the package itself costs: beside the call in Rust, in threads, in memory, and until Ctrl-C is heard.

    pip install ./python && python python/benchmarks/costs.py [--rows 5000000]

Prints the time of `Experiment.estimate` beside that of the same work in Rust; how much more two threads do than one; how much memory a process has more
after 100 estimates than after 10; the most memory that an estimate of a long recording takes beside its arrays, those that go in and those that come
out, of one that the filter follows and of one with jumps at which it loses the signal, with those of its report and of its pictures; and the longest
time from Ctrl-C to the end of the work, over several moments of it. Numbers are reported and gate nothing.
"""

from __future__ import annotations

import argparse
import csv
import os
import resource
import signal
import statistics
import subprocess
import sys
import threading
import time
import warnings
from pathlib import Path

import numpy as np

import kalmems

EXAMPLE = Path(__file__).resolve().parents[2] / "examples/shared_scanner"
CYCLES = 23_987
"""Samples of 376 cycles of the drive, to 0.004 of one: as often as they are repeated, the filter does not lose the signal."""


def read(name: str) -> dict[str, np.ndarray]:
    with (EXAMPLE / name).open(newline="", encoding="utf-8") as lines:
        names, *rows = list(csv.reader(lines))
    return {name: np.array([float(row[place]) for row in rows]) for place, name in enumerate(names)}


def long(columns: dict[str, np.ndarray], rows: int, repeated: int | None = None) -> dict[str, np.ndarray]:
    """The example, or so many samples of it, again and again on one clock."""
    found = {name: np.resize(values[:repeated], rows) for name, values in columns.items()}
    found["time_s"] = np.round(np.arange(rows) * 1e-6, 9)
    return found


def by_ekf() -> kalmems.Experiment:
    text = kalmems.Experiment.load(EXAMPLE / "experiment.toml").to_dict()
    text["estimate"]["filter"] = [one for one in text["estimate"]["filter"] if one["name"] == "EKF"]
    return kalmems.Experiment.from_dict(text, EXAMPLE / "experiment.toml")


def binding() -> None:
    for what, rows in (("the example, 24 001 rows", 24_001), ("500 000 rows", 500_000)):
        recording, experiment = kalmems.Recording(long(read("recording.csv"), rows)), by_ekf()
        shares = []
        for _ in range(20 if rows < 100_000 else 5):
            begun = time.perf_counter()
            result = experiment.estimate(recording)
            whole = time.perf_counter() - begun
            shares.append((whole, result._native().took_s()))
        whole, rust = min(shares)
        share = statistics.median(100 * (whole / rust - 1) for whole, rust in shares)
        print(f"estimate of {what}: {1e3 * whole:.2f} ms, of it in Rust {1e3 * rust:.2f} ms; the rest is {share:.1f} % (median)")


def threads() -> None:
    recording, experiment = kalmems.Recording(long(read("recording.csv"), 200_000)), by_ekf()

    def some(count: int) -> None:
        for _ in range(count):
            experiment.estimate(recording)

    def time_of(workers: int) -> float:
        each = [threading.Thread(target=some, args=(4,)) for _ in range(workers)]
        begun = time.perf_counter()
        for thread in each:
            thread.start()
        for thread in each:
            thread.join()
        return time.perf_counter() - begun

    ratios = [2 * time_of(1) / time_of(2) for _ in range(5)]
    quartiles = statistics.quantiles(ratios, n=4)
    print(f"two threads do {statistics.median(ratios):.2f} times the work of one (quartiles {quartiles[0]:.2f} and {quartiles[2]:.2f})")
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    if hasattr(os, "getloadavg"):
        print(f"  on {cores} cores under a load of {os.getloadavg()[0]:.1f}")


def peak() -> int:
    """The most memory that this process had, in bytes."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


def memory(rows: int) -> None:
    recording, experiment = kalmems.Recording(read("recording.csv")), by_ekf()
    for _ in range(10):
        experiment.estimate(recording)
    before = peak()
    for _ in range(100):
        experiment.estimate(recording)
    print(f"100 estimates more: {(peak() - before) / 1e6:.2f} MB more at most")
    # Each in a process of its own, whose peak is that of this work alone.
    for repeated in (CYCLES, len(recording)):
        subprocess.run([sys.executable, __file__, "--long", str(rows), "--repeated", str(repeated)], check=True)


def long_recording(rows: int, repeated: int) -> None:
    recording, experiment = kalmems.Recording(long(read("recording.csv"), rows, repeated)), by_ekf()
    before = peak()
    result = experiment.estimate(recording)
    arrays = sum(recording[name].nbytes for name in recording.columns)
    out = sum(values.nbytes for one in result for values in one.columns().values())
    events = result.metrics["recordings"][0]["segments"][0]["estimators"][0]["lock"]["events"]
    lost = sum(event["kind"] == "lost" for event in events)
    print(
        f"{rows} rows, the signal lost {lost} times: arrays of {arrays / 1e6:.0f} MB in and {out / 1e6:.0f} MB out; "
        f"the process has {peak() / 1e6:.0f} MB at most, {before / 1e6:.0f} MB of them before: {peak() / (arrays + out):.2f} times the arrays"
    )
    begun = time.process_time()
    page = result.report_html()
    took = time.process_time() - begun
    print(f"its report: {len(page) / 1e6:.2f} MB in {took:.2f} s; {peak() / (arrays + out):.2f} times the arrays")
    try:
        result.plot(window=(0.0, 0.001)).figure.canvas.draw()
    except ImportError as error:
        print(f"no picture: {error}")
        return
    # The first picture of a process reads matplotlib's fonts.
    for what, window in (("the last cycles", None), ("the whole recording", (None, None))):
        begun = time.process_time()
        result.plot(window=window).figure.canvas.draw()
        print(f"a picture of {what}: {time.process_time() - begun:.2f} s; {peak() / (arrays + out):.2f} times the arrays")


def interruption() -> None:
    base, truth = read("recording.csv"), read("reference.csv")
    rows = 2_000_000
    recording, reference = kalmems.Recording(long(base, rows)), kalmems.Recording(long(truth, rows))
    experiment = by_ekf()
    stages: list[tuple[float, str]] = []
    begun = time.monotonic()
    experiment.estimate(recording, reference=reference, progress=lambda what, *_: stages.append((time.monotonic() - begun, what)))
    whole = time.monotonic() - begun
    worst: dict[str, float] = {}
    for share in np.linspace(0.02, 0.98, 25):
        sent: list[float] = []

        def ring(_: int, __: object) -> None:
            sent.append(time.monotonic())
            raise KeyboardInterrupt

        signal.signal(signal.SIGALRM, ring)
        signal.setitimer(signal.ITIMER_REAL, share * whole)
        asked = time.monotonic()
        stage = "none"

        def hear(what: str, *_: object) -> None:
            nonlocal stage
            stage = what

        try:
            experiment.estimate(recording, reference=reference, progress=hear)
            signal.setitimer(signal.ITIMER_REAL, 0)
            continue
        except KeyboardInterrupt:
            ended = time.monotonic()
        # From when the signal came, not from when the interpreter first looked.
        worst[stage] = max(worst.get(stage, 0.0), ended - (asked + share * whole))
    for stage, took in worst.items():
        print(f"Ctrl-C of an estimate of {rows} rows with reference, last heard while {stage}: {took:.2f} s at most")


def main() -> None:
    arguments = argparse.ArgumentParser()
    arguments.add_argument("--rows", type=int, default=5_000_000)
    arguments.add_argument("--long", type=int, help=argparse.SUPPRESS)
    arguments.add_argument("--repeated", type=int, default=CYCLES, help=argparse.SUPPRESS)
    told = arguments.parse_args()
    warnings.simplefilter("ignore", kalmems.VerdictWarning)
    if told.long:
        long_recording(told.long, told.repeated)
        return
    binding()
    threads()
    memory(told.rows)
    interruption()


if __name__ == "__main__":
    main()
