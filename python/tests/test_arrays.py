"""Arrays give what their files give, to the last bit."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import pytest
from conftest import EXAMPLES, read

import kalmems

RIGS = {
    "shared_scanner": ({None: "recording.csv"}, {None: "reference.csv"}, ()),
    "threshold_scanner": ({None: "recording.csv"}, {}, ()),
    "micro_stage": (
        {"sweep": "sweep.csv", "bias-on": "bias_on.csv", "bias-off": "bias_off.csv", "zero-drive": "zero_drive.csv"},
        {},
        ("record", "frequency_Hz"),
    ),
    "accelerometer": ({None: "recording.csv"}, {None: "reference.csv"}, ()),
    "piston_mirror": ({None: "recording.csv"}, {None: "reference.csv"}, ()),
    "comb_resonator": ({None: "recording.csv"}, {None: "reference.csv"}, ()),
}


def given(folder: Path, files: dict[str | None, str], labels: tuple[str, ...]) -> object:
    recordings = {name: kalmems.Recording(read(folder / file, labels)) for name, file in files.items()}
    return recordings[None] if None in recordings else recordings or None


@pytest.mark.filterwarnings("ignore::kalmems.VerdictWarning")
@pytest.mark.parametrize("rig", RIGS)
def test_arrays_give_the_trajectories_of_files_to_the_last_bit(rig: str, tmp_path: Path) -> None:
    recordings, references, labels = RIGS[rig]
    folder = EXAMPLES / rig
    experiment = kalmems.Experiment.load(folder / "experiment.toml")
    of_files = experiment.estimate()
    # Where there are no files.
    elsewhere = kalmems.Experiment(experiment.to_toml(), tmp_path / "experiment.toml")
    of_arrays = elsewhere.estimate(given(folder, recordings, labels), reference=given(folder, references, labels))
    assert len(of_files) == len(of_arrays) > 0
    for file, array in zip(of_files, of_arrays, strict=True):
        assert file.columns().keys() == array.columns().keys()
        for name, values in file.columns().items():
            assert values.tobytes() == array.columns()[name].tobytes(), (file.name, name)
    told = [of.metrics["recordings"][0]["segments"][0]["estimators"] for of in (of_files, of_arrays)]
    assert told[0] == told[1]
    assert of_files.sources != of_arrays.sources


def test_the_command_line_writes_these_numbers(scanner: kalmems.Experiment, tmp_path: Path) -> None:
    from kalmems._kalmems import run_command

    assert run_command(["kalmems", "estimate", str(scanner.path), "--out", str(tmp_path / "out")]) == 0
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        result = scanner.estimate()
    written = read(tmp_path / "out/trajectory_ekf.csv")
    own = result["EKF"].columns()
    assert list(written) == list(own)
    for name, values in own.items():
        assert np.array_equal(written[name], values, equal_nan=True), name


@pytest.mark.filterwarnings("ignore::kalmems.VerdictWarning")
def test_views_are_read_only_and_outlive_their_result(scanner: kalmems.Experiment, recorded: dict[str, np.ndarray]) -> None:
    angle = scanner.estimate(kalmems.Recording(recorded), reference=None)["EKF"].angle
    assert not angle.flags.owndata and not angle.flags.writeable
    with pytest.raises(ValueError):
        angle.flags.writeable = True
    before = angle.copy()
    for _ in range(3):
        scanner.estimate(kalmems.Recording(recorded))
    assert np.array_equal(before, angle)


def test_a_recording_is_its_own_and_read_only(recorded: dict[str, np.ndarray]) -> None:
    signal = recorded["cap_V"].copy()
    recording = kalmems.Recording({**recorded, "cap_V": signal})
    digest = recording.sha256
    assert kalmems.Recording(recorded).sha256 == digest
    signal[5] += 1e-9
    assert recording.sha256 == digest != kalmems.Recording({**recorded, "cap_V": signal}).sha256
    with pytest.raises(ValueError):
        recording["cap_V"][0] = 1.0
    assert "cap_V" in recording and "cap" not in recording and tuple(recording) == recording.columns == tuple(recorded)


@pytest.mark.filterwarnings("ignore::kalmems.VerdictWarning")
def test_a_recording_does_not_change_with_the_arrays_that_it_was_made_of() -> None:
    import pickle

    values = np.linspace(0.0, 1.0, 1000)
    masked = np.ma.MaskedArray(np.ones(1000), np.zeros(1000, dtype=bool))
    recording = kalmems.Recording({"time_s": np.arange(1000) * 1e-6, "cap_V": values, "drive_V": masked})
    digest = recording.sha256
    # A buffer of an acquisition, used again.
    values[:] = 0.0
    masked[:] = np.ma.masked
    assert recording["cap_V"].max() == 1.0 and recording["drive_V"].count() == 1000
    again = pickle.loads(pickle.dumps(recording))
    assert again.sha256 == digest == recording.sha256
    for one in (recording, again):
        with pytest.raises(ValueError, match="read-only"):
            one["cap_V"][0] = 2.0


def test_masked_and_missing_samples_are_counted_by_sample(
    scanner: kalmems.Experiment, recorded: dict[str, np.ndarray], truth: dict[str, np.ndarray]
) -> None:
    mask = np.zeros(len(recorded["cap_V"]), bool)
    mask[[402, 9000]] = True
    masked = np.ma.MaskedArray(recorded["cap_V"], mask)
    missing = np.where(mask, np.nan, recorded["cap_V"])
    results = [
        scanner.estimate(kalmems.Recording({**recorded, "cap_V": signal}), reference=kalmems.Recording(truth))
        for signal in (masked, missing)
    ]
    kinds = []
    for result in results:
        (finding,) = [f for f in result.metrics["recordings"][0]["diagnosis"] if f["column"] == "cap_V"]
        assert (finding["first_row"], finding["count"]) == (402, 2)
        assert finding["message"].startswith("sample 402, column `cap_V`: ")
        kinds.append(finding["kind"])
        assert np.isnan(result["EKF"].innovation[402]) and np.isfinite(result["EKF"].angle[402])
    assert kinds == ["missing", "nan"]
    assert np.array_equal(results[0]["EKF"].angle, results[1]["EKF"].angle)


@pytest.mark.filterwarnings("ignore::kalmems.VerdictWarning")
def test_units_types_and_clocks_are_understood(scanner: kalmems.Experiment, recorded: dict[str, np.ndarray]) -> None:
    plain = scanner.estimate(kalmems.Recording(recorded))["EKF"]
    nanoseconds = np.round(recorded["time_s"] * 1e9).astype("int64")
    recording = kalmems.Recording(
        {"t": nanoseconds, "drive_V": recorded["drive_V"].astype(">f8"), "cap_V": recorded["cap_V"]}, units={"t": "ns"}, clock="t"
    )
    assert np.array_equal(plain.angle, scanner.estimate(recording)["EKF"].angle)
    dates = np.datetime64("2026-01-01T00:00:00", "ns") + nanoseconds
    dated = scanner.estimate(kalmems.Recording({**recorded, "time_s": dates}))["EKF"]
    assert np.allclose(plain.angle, dated.angle, atol=1e-9)
    rate = 1 / np.median(np.diff(recorded["time_s"]))
    sampled = kalmems.Recording({name: recorded[name] for name in ("drive_V", "cap_V")}, clock=float(np.round(rate)))
    assert np.allclose(plain.angle, scanner.estimate(sampled)["EKF"].angle, atol=1e-6)


def test_tables_are_recordings(recorded: dict[str, np.ndarray]) -> None:
    digest = kalmems.Recording(recorded).sha256
    made = {
        "pandas": lambda module: module.DataFrame(recorded),
        "polars": lambda module: module.DataFrame(recorded),
        "pyarrow": lambda module: module.table(recorded),
        "xarray": lambda module: module.Dataset({name: ("k", values) for name, values in recorded.items()}),
    }
    found = 0
    for name, make in made.items():
        try:
            module = __import__(name)
        except ImportError:
            continue
        assert kalmems.Recording(make(module)).sha256 == digest, name
        found += 1
    structured = np.rec.fromarrays(list(recorded.values()), names=list(recorded))
    assert kalmems.Recording(structured).sha256 == digest
    if not found:
        pytest.skip("no library of tables is installed")


def test_arrays_that_are_no_columns_are_refused() -> None:
    for columns, expected in [
        ({"a_V": np.zeros((2, 2))}, "axes"),
        ({"a_V": np.zeros(2, complex)}, "type complex128"),
        ({"a_V": np.zeros(2), "b_V": np.zeros(3)}, "one length"),
        ({"a_V": np.array([1.0, object()])}, "Python objects"),
        (5, "expected a mapping"),
    ]:
        with pytest.raises((ValueError, TypeError), match=expected):
            kalmems.Recording(columns)
