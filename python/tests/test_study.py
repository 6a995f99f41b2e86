"""Studies in parts are those of the command, to the last byte."""

from __future__ import annotations

import pickle
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import pytest
from conftest import EXAMPLES

import kalmems
from kalmems._kalmems import run_command

STIFFNESS = "device.shared_scanner.resonator.stiffness"


def made() -> kalmems.Study:
    experiment = kalmems.Experiment.load(EXAMPLES / "shared_scanner/simulation.toml").replace({"simulate.duration": "10 ms"})
    return experiment.study(
        [{"key": STIFFNESS, "name": "stiffness", "applies_to": "told", "values": ["1.098e-4 N m", "1.10e-4 N m", "1.102e-4 N m"]}],
        repeats=2,
        seed=1,
        truth={STIFFNESS: "1.10e-4 N m"},
        name="small",
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
    assert {row["stiffness"] for row in whole.rows()} and merged.summary["runs"] == 6
    # By files and the command.
    (text, experiment, _) = study._texts
    (tmp_path / "simulation.toml").write_text(experiment)
    (tmp_path / "study.toml").write_text(text)
    assert run_command(["kalmems", "study", str(tmp_path / "study.toml"), "--out", str(tmp_path / "command")]) == 0
    assert results(tmp_path / "command") == results(whole.folder)


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


def test_a_study_that_is_wrong_names_its_key() -> None:
    experiment = kalmems.Experiment.load(EXAMPLES / "shared_scanner/simulation.toml")
    with pytest.raises(kalmems.ExperimentError, match="grid"):
        experiment.study([{"key": STIFFNESS, "gird": {}}])
