"""Mistakes that are made with the package: each is an error that names what to write instead."""

from __future__ import annotations

import pickle
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import EXAMPLES, read

import kalmems
from kalmems import filters

pytestmark = pytest.mark.filterwarnings("ignore::kalmems.VerdictWarning")

FOLDER = EXAMPLES / "shared_scanner"
EYE, SEEN = np.eye(2), [[1.0, 0.0]]
VARIED = {"key": "estimate.skip", "values": ["4 ms", "8 ms"]}


@dataclass
class Bench:
    """What mistakes are made with."""

    experiment: kalmems.Experiment
    stage: kalmems.Experiment
    simulation: kalmems.Experiment
    live: kalmems.Experiment
    columns: dict[str, np.ndarray]
    result: kalmems.Result
    folder: Path

    def recording(self, **options: Any) -> kalmems.Recording:
        return kalmems.Recording(self.columns, **options)

    def study(self) -> kalmems.Study:
        return self.simulation.study([VARIED])

    def without(self, column: str) -> dict[str, np.ndarray]:
        return {name: values for name, values in self.columns.items() if name != column}


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Bench:
    names = ("experiment", "simulation", "stream")
    experiment, simulation, live = (kalmems.Experiment.load(FOLDER / f"{name}.toml") for name in names)
    stage = kalmems.Experiment.load(EXAMPLES / "micro_stage/experiment.toml")
    columns, folder = read(FOLDER / "recording.csv"), tmp_path_factory.mktemp("mistakes")
    (folder / "file").write_text("")
    return Bench(experiment, stage, simulation, live, columns, experiment.estimate(), folder)


def kalman(**other: Any) -> filters.Filtered:
    return filters.kalman(**{"z": np.zeros(5), "F": EYE, "H": SEEN, "Q": EYE, "R": 1, "x0": [0, 0], "P0": EYE, **other})


def ekf(z: Any = (0.0, 0.0), u: Any = None, **other: Any) -> filters.Filtered:
    model = {"f": lambda x: x, "h": lambda x: x[:1], "Q": EYE, "R": 1, **other}
    return filters.Ekf(**model).run(z, [0, 0], EYE, u)


MISTAKES: list[tuple[str, Callable[[Bench], object], type[Exception], str]] = [
    # Experiments.
    ("a path as the text of an experiment", lambda _: kalmems.Experiment("scan.toml"), kalmems.ExperimentError, "read it: `Experiment.load('scan.toml')`"),
    ("a file that is not there", lambda _: kalmems.Experiment.load("nowhere.toml"), FileNotFoundError, "nowhere.toml"),
    ("a recording as an experiment", lambda _: kalmems.Experiment.load(FOLDER / "recording.csv"), kalmems.ExperimentError, "if it is a recording, `kalmems new"),
    ("no device", lambda _: kalmems.Experiment('name = "x"'), kalmems.ExperimentError, "add one of the tables `[device.shared_scanner]`"),
    ("a quote that is not closed", lambda _: kalmems.Experiment('name = "x'), kalmems.ExperimentError, "expected `\"`"),
    ("a list as a document", lambda _: kalmems.Experiment.from_dict([1]), kalmems.ExperimentError, "expected a mapping of keys to values"),
    ("a function as a value", lambda _: kalmems.Experiment.from_dict({"name": print}), TypeError, "expected text, a number, True or False, a list or a dictionary"),
    ("a misspelt key", lambda b: b.experiment.replace({"estimate.skpi": "8 ms"}), kalmems.ExperimentError, "did you mean `skip`?"),
    ("a misspelt table", lambda b: b.experiment.replace({"estimat.skip": "8 ms"}), kalmems.ExperimentError, "did you mean `estimate`?"),
    ("a number without its unit", lambda b: b.experiment.replace({"estimate.skip": 8}), kalmems.ExperimentError, 'such as `"8 ms"`'),
    ("a unit of another dimension", lambda b: b.experiment.replace({"estimate.skip": "8 mm"}), kalmems.ExperimentError, "`8 mm` has the dimension m; expected a time (s)"),
    ("an array as a value", lambda b: b.experiment.replace({"estimate.skip": np.ones(2)}), kalmems.ExperimentError, 'write `skip = "8 ms"`'),
    ("no way to a key", lambda b: b.experiment.replace({"a..b": 1}), ValueError, "write one such as `simulate.seed`"),
    ("an entry that is not there", lambda b: b.experiment.replace({"recording[7].name": "x"}), kalmems.ExperimentError, "it has 1, counted from 0"),
    ("a key for changes", lambda b: b.experiment.replace("estimate.skip"), kalmems.ExperimentError, 'such as {"estimate.skip": "8 ms"}'),
    # Recordings.
    ("a number as a recording", lambda b: b.experiment.estimate(5), kalmems.RecordingError, 'such as {"time_s": t, "cap_V": y}'),
    ("a list of recordings", lambda b: b.experiment.estimate([b.recording()]), kalmems.RecordingError, "several recordings are a mapping of their names or roles"),
    ("an array without names", lambda b: b.experiment.estimate(np.zeros((9, 3))), kalmems.RecordingError, 'name its columns, such as {"time_s": array[:, 0]'),
    ("a path as a recording", lambda _: kalmems.Recording("scan.csv"), kalmems.RecordingError, "`experiment.estimate('scan.csv')`"),
    ("a file that is elsewhere", lambda b: b.experiment.estimate("s3://bucket/scan.csv"), kalmems.RecordingError, "copy it here first, or use `estimate_many`"),
    ("recordings and columns together", lambda b: b.experiment.estimate({"test": b.recording(), "cap_V": [0.0]}), kalmems.RecordingError, "give either recordings or columns"),
    ("another name of a recording", lambda b: b.stage.estimate({"swep": b.recording()}), kalmems.ExperimentError, "there are `sweep` of the role `sweep`"),
    ("one recording of several", lambda b: b.stage.estimate(b.recording()), kalmems.ExperimentError, "say it by name or role"),
    ("one path of several", lambda b: b.stage.estimate("sweep.csv"), kalmems.ExperimentError, "give a mapping of a name or role to it"),
    ("a column that is missing", lambda b: b.experiment.estimate(b.without("cap_V")), kalmems.RecordingError, "there are `time_s`, `drive_V`"),
    ("arrays in place of a file without a column of it", lambda b: b.experiment.estimate(b.without("cap_V")), kalmems.RecordingError, "the arrays in place of `"),
    ("a column with another name", lambda b: b.experiment.estimate({**b.without("cap_V"), "cap": b.columns["cap_V"]}), kalmems.RecordingError, "did you mean `cap`?"),
    ("a column of objects", lambda b: b.experiment.estimate({**b.columns, "cap_V": [{}] * len(b.columns["cap_V"])}), kalmems.RecordingError, "give numbers or texts"),
    ("complex numbers", lambda b: b.experiment.estimate({**b.columns, "cap_V": 1j * b.columns["cap_V"]}), kalmems.RecordingError, "give real numbers"),
    ("columns of two lengths", lambda b: b.experiment.estimate({**b.columns, "cap_V": b.columns["cap_V"][:-1]}), kalmems.KalmemsError, "give columns of one length"),
    ("times that go back", lambda b: b.experiment.estimate({**b.columns, "time_s": b.columns["time_s"][::-1]}), kalmems.RecordingError, "sort the rows"),
    ("a few samples", lambda b: b.experiment.estimate({name: values[:5] for name, values in b.columns.items()}), kalmems.EstimationError, "shorten it or record for longer"),
    ("no sample", lambda b: b.experiment.estimate({name: values[:0] for name, values in b.columns.items()}), kalmems.RecordingError, "expected a line of names"),
    ("a signal of nothing but gaps", lambda b: b.experiment.estimate({**b.columns, "cap_V": np.nan * b.columns["cap_V"]}), kalmems.EstimationError, "has no finite sample"),
    ("units as a list", lambda b: b.recording(units=["V"]), kalmems.RecordingError, 'such as {"cap_V": "mV"}'),
    ("a unit that nobody knows", lambda b: b.experiment.estimate(b.recording(units={"cap_V": "banana"})), kalmems.ExperimentError, 'such as `unit = "mV"`'),
    ("a unit of a capacitance for a voltage", lambda b: b.experiment.estimate(b.recording(units={"cap_V": "pF"})), kalmems.RecordingError, "is in `pF`; expected a voltage (V)"),
    ("a clock as a list", lambda b: b.recording(clock=[1.0]), kalmems.RecordingError, "or the sampling rate in Hz as a number"),
    ("a negative rate", lambda b: b.experiment.estimate(b.recording(clock=-1.0)), kalmems.ExperimentError, "expected a frequency above 0"),
    ("a reference that the experiment does not describe", lambda b: b.experiment.replace({"recording[0].reference": None}).estimate(reference=b.recording()), kalmems.ExperimentError, "say what its columns are"),
    ("another column of a recording", lambda b: b.recording()["cap"], KeyError, "there are time_s, drive_V, cap_V"),
    # Results.
    ("another filter", lambda b: b.result["LKF"], KeyError, "there are 'Model alone', 'EKF', 'UKF'"),
    ("another state", lambda b: b.result["EKF"].position, AttributeError, "a trajectory of angle, rate has no `position`"),
    ("the claim of a model", lambda b: b.result["Model alone"].angle_sd, AttributeError, "'Model alone' claims no standard deviation"),
    ("another state to draw", lambda b: b.result.plot("angel"), KeyError, "there are angle, rate"),
    ("another figure", lambda b: b.result.plot(figure="nsi"), KeyError, "it has 'motion', 'angle_error', 'phase_error', 'nis'"),
    ("a number as a window", lambda b: b.result.plot(window=5), ValueError, "a pair of times in s, such as (0.01, 0.02)"),
    ("a window without samples", lambda b: b.result.plot(window=(5, 6)), ValueError, "the segments cover 0 s to 0.024 s"),
    ("a state of a figure", lambda b: b.result.plot("angle", figure="nis"), ValueError, "leave `state`, `window` and `ax` out"),
    ("the report outside of a notebook", lambda b: b.result.show(), kalmems.KalmemsError, "`write(folder)` writes it as a file"),
    ("a file as a folder of results", lambda b: b.result.write(b.folder / "file"), kalmems.KalmemsError, "give another one"),
    ("pictures of another process", lambda b: pickle.loads(pickle.dumps(b.result)).figures(), kalmems.KalmemsError, "make its report where it was estimated"),
    # Other work.
    ("a simulation that is not described", lambda b: b.experiment.simulate(), kalmems.ExperimentError, "add the table `[simulate]`"),
    ("a negative seed", lambda b: b.simulation.simulate(seed=-1), kalmems.ExperimentError, "write `0` or more"),
    ("nothing to identify from", lambda b: b.experiment.identify(), kalmems.ExperimentError, "where `[identify]` names them"),
    ("a filter to diagnose by", lambda b: b.experiment.diagnose(filter="LKF"), kalmems.ExperimentError, "there are `Model alone`, `EKF`, `UKF`"),
    ("a pattern without a file", lambda b: b.experiment.estimate_many("nowhere/*.csv", b.folder / "many"), ValueError, "no file matches `nowhere/*.csv`"),
    ("an image as a calibration", lambda _: kalmems.calibrate(FOLDER / "image.toml"), kalmems.ExperimentError, "known keys: name, description, gyroscope"),
    ("a table for a list", lambda b: b.simulation.study(VARIED), kalmems.ExperimentError, "`vary` is a list with a table for each key"),
    ("a misspelt key of a study", lambda b: b.simulation.study([{**VARIED, "gird": {}}]), kalmems.ExperimentError, "did you mean `grid`?"),
    ("no run of a study", lambda b: b.simulation.study([VARIED], repeats=0), kalmems.ExperimentError, "write how many times, such as `10`"),
    ("no part of a study", lambda b: b.study().parts(0), kalmems.KalmemsError, "give as many as there are workers"),
    ("no part to merge", lambda b: b.study().merge([], b.folder / "merged"), kalmems.KalmemsError, "what `run` of each part of `study.parts(count)` returned"),
    ("a number of workers as an executor", lambda b: b.study().run(b.folder / "run", executor=4), kalmems.KalmemsError, "such as `concurrent.futures.ProcessPoolExecutor()`"),
    # Streams.
    ("a stream that is not described", lambda b: list(b.experiment.stream([b""])), kalmems.ExperimentError, "add a table `[stream]`"),
    ("a path as a source", lambda b: b.live.stream("scan.csv"), kalmems.RecordingError, "`experiment.stream(open('scan.csv', 'rb'))`"),
    ("bytes as a source", lambda b: b.live.stream(b"0,1,2"), kalmems.RecordingError, "`experiment.stream([content])`"),
    ("a number as a source", lambda b: b.live.stream(5), kalmems.RecordingError, "expected something that gives pieces"),
    ("numbers as pieces", lambda b: list(b.live.stream([0.0, 1.0])), kalmems.RecordingError, "gave float; expected bytes, text, an array"),
    ("an array of two columns for three", lambda b: list(b.live.stream(np.zeros((9, 2)))), kalmems.RecordingError, "expected 3 columns, time_s, drive_V, cap_V"),
    # Filters.
    ("a matrix of another shape", lambda _: kalman(F=np.eye(3)), ValueError, "`F` has the shape [3, 3]; expected [2, 2]"),
    ("a matrix that is laid flat", lambda _: kalman(F=[1, 0, 0, 1]), ValueError, "`F` has the shape [4]; expected [2, 2]"),
    ("a sensor that is transposed", lambda _: kalman(H=[[1], [0]]), ValueError, "`H` has the shape [2, 1]; expected [1, 2]"),
    ("samples as a row", lambda _: kalman(z=np.zeros((1, 500))), ValueError, "a row is a sample and a column a measurement: give `z.T`"),
    ("samples of three axes", lambda _: kalman(z=np.zeros((2, 2, 2))), ValueError, "expected a row for each sample"),
    ("samples as texts", lambda _: kalman(z=["a"]), ValueError, "`z` cannot be read as numbers"),
    ("an infinite sample", lambda _: kalman(z=[0.0, np.inf]), ValueError, "a sample that is missing is `nan`"),
    ("a state as a column", lambda _: kalman(x0=[[0], [0]]), ValueError, "of the shape (2,)"),
    ("half of a covariance", lambda _: kalman(P0=[[1, 0.5], [0, 1]]), ValueError, "give `(P0 + P0.T) / 2`"),
    ("standard deviations of opposite signs", lambda _: kalman(Q=[1, -1]), ValueError, "variances are on its diagonal and not negative"),
    ("inputs without their matrix", lambda _: kalman(u=np.zeros(5)), ValueError, "give both or none"),
    ("inputs of other samples", lambda _: kalman(B=[[0], [1]], u=np.zeros(4)), ValueError, "`u` has the shape [4, 1]; expected [5, 1]"),
    ("more states than a filter has", lambda _: kalman(F=np.eye(25), H=np.ones((1, 25)), Q=np.eye(25), x0=np.zeros(25), P0=np.eye(25)), ValueError, "1 to 24 states"),
    ("a matrix as a function", lambda _: ekf(f=EYE), TypeError, "such as `lambda x: matrix @ x`, or use `kalman`"),
    ("a function that gives nothing", lambda _: ekf(f=lambda x: None), ValueError, "`f` gives an array of the shape (); expected (2,)"),
    ("a function that gives texts", lambda _: ekf(f=lambda x: ["a", "b"]), ValueError, "what `f` gives cannot be read as numbers"),
    ("a number for two measurements", lambda _: ekf(np.zeros((3, 2)), h=lambda x: x[0], R=EYE), ValueError, "`h` gives an array of the shape (); expected (2,)"),
    ("a derivative that is transposed", lambda _: ekf(H=lambda x: [[1], [0]]), ValueError, "`H` gives an array of the shape (2, 1); expected (1, 2)"),
    ("a derivative of another sign", lambda _: ekf(F=lambda x: -EYE), ValueError, "correct it, or leave `F` out and differences are used"),
    ("a function of inputs without any", lambda _: ekf(f=lambda x, u: x), ValueError, "write `f(x)`, or give the inputs `u`"),
    ("inputs that a function does not take", lambda _: ekf(u=[0.0, 0.0]), ValueError, "write `f(x, u)`"),
    ("no spread of the sigma points", lambda _: filters.Ukf(lambda x: x, lambda x: x, Q=1, R=1, alpha=0), ValueError, "above 0, such as 1"),
]


def test_there_are_more_than_sixty_mistakes_and_each_is_another() -> None:
    names = [name for name, *_ in MISTAKES]
    assert len(names) > 60 and len(set(names)) == len(names)


@pytest.mark.parametrize("name", [name for name, *_ in MISTAKES])
def test_a_mistake_names_what_to_write_instead(bench: Bench, name: str) -> None:
    (_, call, kind, mend), *_ = [one for one in MISTAKES if one[0] == name]
    if name.endswith("to draw") or "window" in name:
        pytest.importorskip("matplotlib").use("Agg")
    with pytest.raises(kind, match=re.escape(mend)):
        call(bench)
