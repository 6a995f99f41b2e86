"""Interruption, threads, memory and types."""

from __future__ import annotations

import os
import resource
import subprocess
import sys
import threading
import time

import numpy as np
import pytest
from conftest import EXAMPLES

import kalmems

pytestmark = pytest.mark.filterwarnings("ignore::kalmems.VerdictWarning")


def long_recording(recorded: dict[str, np.ndarray], times: int) -> kalmems.Recording:
    """The example again and again, on one clock."""
    rows = len(recorded["time_s"])
    interval = 1e-6
    return kalmems.Recording(
        {
            "time_s": np.round(np.arange(rows * times) * interval, 9),
            "drive_V": np.tile(recorded["drive_V"], times),
            "cap_V": np.tile(recorded["cap_V"], times),
        }
    )


def test_progress_is_told_and_may_raise(scanner: kalmems.Experiment, recorded: dict[str, np.ndarray]) -> None:
    told = []
    scanner.estimate(long_recording(recorded, 10), progress=lambda *what: told.append(what))
    assert all(isinstance(what, str) and 0 <= done for what, done, _ in told)

    def stop(*_: object) -> None:
        raise RuntimeError("enough")

    with pytest.raises(RuntimeError, match="enough"):
        scanner.estimate(long_recording(recorded, 40), progress=stop)


def test_other_threads_run_while_an_estimate_does(scanner: kalmems.Experiment, recorded: dict[str, np.ndarray]) -> None:
    recording = long_recording(recorded, 20)
    done = threading.Event()
    counted = 0

    def work() -> None:
        scanner.estimate(recording)
        done.set()

    thread = threading.Thread(target=work)
    thread.start()
    while not done.is_set():
        counted += 1
        time.sleep(0.001)
    thread.join()
    assert counted > 20


def test_estimates_in_threads_are_the_same(scanner: kalmems.Experiment, recorded: dict[str, np.ndarray]) -> None:
    recording = kalmems.Recording(recorded)
    expected = scanner.estimate(recording)["EKF"].angle
    found: list[np.ndarray] = []
    threads = [threading.Thread(target=lambda: found.append(scanner.estimate(recording)["EKF"].angle)) for _ in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(found) == 3 and all(np.array_equal(expected, angle) for angle in found)


def test_memory_does_not_grow_over_estimates(scanner: kalmems.Experiment, recorded: dict[str, np.ndarray]) -> None:
    recording = kalmems.Recording(recorded)

    def peak() -> int:
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss

    for _ in range(10):
        scanner.estimate(recording)
    before = peak()
    for _ in range(100):
        scanner.estimate(recording)
    grown = (peak() - before) * 1024
    one = sum(values.nbytes for trajectory in scanner.estimate(recording) for values in trajectory.columns().values())
    assert grown < 10 * one, f"{grown} bytes after 100 results of {one}"


def test_the_command_is_there() -> None:
    run = subprocess.run(
        [sys.executable, "-m", "kalmems", "inspect", str(EXAMPLES / "shared_scanner/recording.csv")],
        capture_output=True,
        text=True,
        check=True,
        env=os.environ,
    )
    assert "cap_V" in run.stdout
    assert subprocess.run([sys.executable, "-m", "kalmems", "--nothing"], capture_output=True).returncode == 2
