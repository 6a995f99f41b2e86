"""10 000 short runs on workers beside the same runs without a scheduler.

    pip install ./python distributed && python python/benchmarks/scheduler.py

Runs a study of 10 000 runs, each a simulation of 1 ms and its estimate, on so many processes without a scheduler, each its share, and then as parts on a Dask
cluster of as many workers; prints both times, how much longer the second is, and whether the results are the same to the last byte. The time that the
workers take to start counts in neither. Times are reported and gate nothing.
"""

from __future__ import annotations

import argparse
import importlib
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import kalmems
from kalmems._executor import finished

EXAMPLE = Path(__file__).resolve().parents[2] / "examples/shared_scanner/simulation.toml"
STIFFNESS = "device.shared_scanner.resonator.stiffness"


def study(runs: int) -> kalmems.Study:
    experiment = kalmems.Experiment.load(EXAMPLE).replace(
        {
            "simulate.duration": "1 ms",
            "simulate.integration_rate": "1 MHz",
            "simulate.start.angle": "0.1 rad",
            "estimate.skip": "0.2 ms",
            "estimate.first_peak": None,
            "estimate.filter[0].start.angle": "0.1 rad",
            "estimate.filter[0].start_sd": {"angle": "0.01 rad", "rate": "1e3 rad/s"},
        }
    )
    vary = [{"key": STIFFNESS, "name": "stiffness", "applies_to": "told", "values": ["1.098e-4 N m", "1.102e-4 N m"]}]
    return experiment.study(vary, repeats=runs // 2, truth={STIFFNESS: "1.10e-4 N m"}, name="scheduler")


def warm(_: int = 0) -> None:
    """Has a worker import the package, and what a first part needs."""
    importlib.import_module("kalmems")
    time.sleep(0.2)


def timed(part: kalmems.Part) -> tuple[bytes, float]:
    """A part, and the processor's time that it took."""
    begun = time.process_time()
    return part.run(), time.process_time() - begun


def main() -> None:
    import distributed

    arguments = argparse.ArgumentParser()
    arguments.add_argument("--runs", type=int, default=10_000)
    arguments.add_argument("--workers", type=int, default=2)
    arguments.add_argument("--parts", type=int, default=32)
    told = arguments.parse_args()
    whole = study(told.runs)
    parts = told.parts
    with tempfile.TemporaryDirectory() as folder:
        with ProcessPoolExecutor(told.workers, mp_context=get_context("spawn")) as pool:
            list(pool.map(warm, range(told.workers)))
            begun = time.perf_counter()
            shares = [share.result() for share in [pool.submit(timed, part) for part in whole.parts(told.workers)]]
            alone = time.perf_counter() - begun
        work = sum(took for _, took in shares)
        merged = whole.merge([journal for journal, _ in shares], f"{folder}/alone")
        options = {"n_workers": told.workers, "threads_per_worker": 1, "processes": True, "dashboard_address": None}
        with distributed.LocalCluster(**options) as cluster, distributed.Client(cluster) as client:
            client.run(warm)
            before, here = sum(client.run(time.process_time).values()), time.process_time()
            begun = time.perf_counter()
            # As `Study.run` does, but for the results in a folder, which are written in both cases.
            journals = finished(client, whole.parts(parts), None, None)
            scheduled = time.perf_counter() - begun
            here = time.process_time() - here
            there = sum(client.run(time.process_time).values()) - before
        again = whole.merge(journals, f"{folder}/scheduled")
        same = (merged.folder / "results.csv").read_bytes() == (again.folder / "results.csv").read_bytes()
    print(f"{told.runs} runs, {told.workers} workers: {alone:.2f} s without a scheduler, {scheduled:.2f} s in {parts} parts on Dask")
    print(f"processor's time: {work:.2f} s without a scheduler; {there:.2f} s of workers and {here:.2f} s of scheduler and client on Dask")
    print(f"the scheduler takes {100 * (scheduled / alone - 1):+.1f} % of the time and {100 * ((there + here) / work - 1):+.1f} % of the processor's time")
    print(f"results are {'the same' if same else 'NOT the same'}")


if __name__ == "__main__":
    main()
