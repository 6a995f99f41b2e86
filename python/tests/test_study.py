"""Studies in parts are those of the command, to the last byte."""

from __future__ import annotations

import logging
import os
import pickle
import signal
import threading
from collections.abc import Sequence
from concurrent.futures import Future, ProcessPoolExecutor, ThreadPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import pytest
from conftest import EXAMPLES

import kalmems
from kalmems._kalmems import run_command

STIFFNESS = "device.shared_scanner.resonator.stiffness"


def made(repeats: int = 2, figures: Sequence[dict[str, str]] = ()) -> kalmems.Study:
    experiment = kalmems.Experiment.load(EXAMPLES / "shared_scanner/simulation.toml").replace(
        {
            "simulate.duration": "4 ms",
            "simulate.integration_rate": "1 MHz",
            "simulate.start.angle": "0.1 rad",
            "estimate.skip": "1 ms",
        }
    )
    return experiment.study(
        [{"key": STIFFNESS, "name": "stiffness", "applies_to": "told", "values": ["1.098e-4 N m", "1.10e-4 N m", "1.102e-4 N m"]}],
        repeats=repeats,
        seed=1,
        truth={STIFFNESS: "1.10e-4 N m"},
        name="small",
        figures=figures,
    )


def results(folder: Path) -> bytes:
    return (folder / "results.csv").read_bytes()


def test_parts_in_any_order_and_twice_give_the_bytes_of_the_command(tmp_path: Path) -> None:
    study = made()
    assert (study.points, study.runs) == (3, 6)
    whole = study.run(tmp_path / "whole", threads=2)
    parts = [pickle.loads(pickle.dumps(part)).run() for part in study.parts(4)]
    merged = study.merge([*reversed(parts), parts[1]], tmp_path / "merged")
    assert results(whole.folder) == results(merged.folder)
    assert len({row["stiffness_N_m"] for row in whole.rows()}) == 3
    assert (merged.summary["runs"], merged.summary["failures"]) == (6, {})
    # By files and the command.
    (text, experiment, _) = study._texts
    (tmp_path / "simulation.toml").write_text(experiment)
    (tmp_path / "study.toml").write_text(text)
    assert run_command(["kalmems", "study", str(tmp_path / "study.toml"), "--out", str(tmp_path / "command")]) == 0
    assert results(tmp_path / "command") == results(whole.folder)


def test_the_figures_of_a_study_are_drawn(tmp_path: Path) -> None:
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    figures = [{"metric": "errors.angle.rmse_deg", "against": "stiffness", "label": "angle RMSE"}]
    result = made(figures=figures).run(tmp_path / "run")
    (name,) = result.figure_names
    (ax,) = result.plot()
    assert ax is not None and len(ax.get_legend_handles_labels()[0]) >= 1
    assert (result.folder / f"figures/{name}.svg").exists()
    with pytest.raises(KeyError, match="it has none"):
        made().run(tmp_path / "without").plot()


def test_a_missing_part_is_named(tmp_path: Path) -> None:
    study = made()
    parts = [part.run() for part in study.parts(3)[:2]]
    with pytest.raises(kalmems.KalmemsError, match="3/3"):
        study.merge(parts, tmp_path / "out")


def test_an_executor_runs_the_parts(tmp_path: Path) -> None:
    study = made()
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
        pooled = study.run(tmp_path / "pooled", executor=pool, parts=2)
    assert results(pooled.folder) == results(study.run(tmp_path / "here").folder)


class Unreliable:
    """An executor whose workers die on one part and hang on another, the first time."""

    def __init__(self) -> None:
        self.pool = ThreadPoolExecutor(2)
        self.given: list[tuple[int, int]] = []

    def submit(self, function: Any, part: Any, number: int) -> Future[bytes]:
        self.given.append((part.part, number))
        if number == 1 and part.part in (1, 2):
            future: Future[bytes] = Future()
            if part.part == 1:
                future.set_exception(RuntimeError("the worker died"))
            return future
        return self.pool.submit(function, part, number)


def test_parts_of_workers_that_die_or_hang_are_given_out_again(tmp_path: Path) -> None:
    study, executor = made(), Unreliable()
    told: list[tuple[str, int, int]] = []
    run = study.run(
        tmp_path / "run", executor=executor, parts=4, deadline=0.5, progress=lambda *what: told.append(what)
    )
    assert results(run.folder) == results(study.run(tmp_path / "here").folder)
    assert {part for part, number in executor.given if number > 1} >= {1, 2}
    assert told[-1] == ("studying", 4, 4)


class Lost(Future[bytes]):
    """Done, on a worker that hangs since then."""

    def __init__(self) -> None:
        super().__init__()
        self.set_result(b"")

    def result(self, timeout: float | None = None) -> bytes:
        threading.Event().wait()
        return b""


def test_a_part_whose_result_lies_on_a_worker_that_hangs_is_given_out_again(tmp_path: Path) -> None:
    class Forgetful(Unreliable):
        def submit(self, function: Any, part: Any, number: int) -> Future[bytes]:
            self.given.append((part.part, number))
            return Lost() if (part.part, number) == (2, 1) else self.pool.submit(function, part, number)

    study, executor = made(), Forgetful()
    run = study.run(tmp_path / "run", executor=executor, parts=3, deadline=0.5)
    assert results(run.folder) == results(study.run(tmp_path / "here").folder)
    assert (2, 2) in executor.given


def test_a_part_that_fails_each_time_is_told(tmp_path: Path) -> None:
    class Broken:
        def submit(self, function: Any, part: Any, number: int) -> Future[bytes]:
            future: Future[bytes] = Future()
            future.set_exception(RuntimeError(f"attempt {number}"))
            return future

    with pytest.raises(RuntimeError, match="attempt 5"):
        made().run(tmp_path / "run", executor=Broken(), parts=2)


@pytest.mark.skipif(not hasattr(signal, "SIGSTOP"), reason="this system cannot halt a process")
def test_dask_loses_and_doubles_nothing_with_a_worker_killed_one_hung_and_one_joining(tmp_path: Path) -> None:
    distributed = pytest.importorskip("distributed")
    study = made(repeats=8)
    expected = results(study.run(tmp_path / "here").folder)
    options = {"n_workers": 2, "threads_per_worker": 1, "processes": True, "dashboard_address": None}
    with (
        dask_config(),
        distributed.LocalCluster(**options, silence_logs=logging.CRITICAL) as cluster,
        distributed.Client(cluster) as client,
    ):
        first, second = [worker["pid"] for worker in client.run(worker_process).values()]
        killed: list[int] = []

        def heard(what: str, done: int, total: int) -> None:
            if not killed:
                killed.append(done)
                os.kill(first, signal.SIGKILL)
                os.kill(second, signal.SIGSTOP)
                cluster.scale(3)

        try:
            run = study.run(tmp_path / "run", executor=client, parts=12, deadline=3.0, progress=heard)
        finally:
            os.kill(second, signal.SIGKILL)
        assert killed and killed[0] < 12
        assert results(run.folder) == expected
        assert run.summary["runs"] == 24 and not run.summary["failures"]


def worker_process() -> dict[str, int]:
    return {"pid": os.getpid()}


def dask_config() -> Any:
    import dask

    return dask.config.set({"distributed.worker.daemon": True, "distributed.comm.timeouts.connect": "5s"})


def test_a_study_that_is_wrong_names_its_key() -> None:
    experiment = kalmems.Experiment.load(EXAMPLES / "shared_scanner/simulation.toml")
    with pytest.raises(kalmems.ExperimentError, match="grid"):
        experiment.study([{"key": STIFFNESS, "gird": {}}])
