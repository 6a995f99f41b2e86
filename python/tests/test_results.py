"""Results, errors and warnings: what they hold, and that they come back from another process."""

from __future__ import annotations

import gc
import multiprocessing
import pickle
import sys
from collections.abc import Callable
from pathlib import Path
from shutil import copy
from typing import Any

import numpy as np
import pytest
from conftest import EXAMPLES

import kalmems
from kalmems import _arrow, filters


@pytest.fixture(scope="module")
def result() -> kalmems.Result:
    with pytest.warns(kalmems.VerdictWarning, match="EKF"):
        return kalmems.Experiment.load(EXAMPLES / "shared_scanner/experiment.toml").estimate()


def test_a_result_names_filters_states_and_figures(result: kalmems.Result) -> None:
    ekf = result["EKF"]
    assert ekf is result["ekf"] and len(result) == 3 and len(ekf) == len(ekf.time)
    assert ekf.verdict == "overconfident" and ekf.grade == "doubtful"
    assert ekf.metrics["errors"]["angle"]["rmse_deg"] < 0.05
    assert {"angle", "angle_sd", "rate"} <= set(dir(ekf))
    with pytest.raises(AttributeError, match="angle, rate"):
        _ = ekf.position
    with pytest.raises(KeyError, match="'UKF'"):
        _ = result["LKF"]
    for holder in (result, result.segments[0]):
        assert "EKF" in holder and "ekf" in holder and ekf in holder and "LKF" not in holder
    assert result["Model alone"].states["angle"].sd is None
    assert "EKF" in result.summary() and "<table>" in result._repr_html_()
    assert len(result.answers) == 1 and result.answer.startswith("angle: amplitude 8.")
    assert result.metrics["answer"] == result.answers == [result.answer]
    assert result.summary().startswith(result.answers[0]) and "claimed by EKF" in result.answers[0]
    assert kalmems.Experiment(result.experiment_toml()).name == "shared_scanner"


def test_a_result_is_written_as_by_the_command(result: kalmems.Result, tmp_path: Path) -> None:
    folder = result.write(tmp_path / "out")
    assert {"trajectory_ekf.csv", "metrics.json", "report.html", "run.toml"} <= {file.name for file in folder.iterdir()}
    assert (folder / "report.html").read_text(encoding="utf-8") == result.report_html()
    figures = result.figures()
    assert figures["shared_scanner_motion.svg" if "shared_scanner_motion.svg" in figures else next(iter(figures))][:4] in (b"<svg", b"<?xm")


def test_results_and_their_parts_can_be_pickled(result: kalmems.Result) -> None:
    # The report is kept where it was made before.
    result.report_html()
    copy = pickle.loads(pickle.dumps(result))
    assert copy.metrics == result.metrics and copy.notices == result.notices
    assert np.array_equal(copy["EKF"].angle_sd, result["EKF"].angle_sd)
    assert copy.report_html() == result.report_html()
    with pytest.raises(kalmems.KalmemsError, match="another process"):
        copy.figures()


def _estimated(task: tuple[kalmems.Experiment, kalmems.Recording]) -> kalmems.Result:
    experiment, recording = task
    return experiment.estimate(recording)


def _refused(text: str) -> kalmems.Experiment:
    return kalmems.Experiment(text, "somewhere/experiment.toml")


@pytest.mark.filterwarnings("ignore::kalmems.VerdictWarning")
def test_work_and_errors_come_back_from_another_process(
    scanner: kalmems.Experiment, recorded: dict[str, np.ndarray]
) -> None:
    recording = kalmems.Recording(recorded)
    context = multiprocessing.get_context("spawn")
    with context.Pool(1) as pool:
        found = pool.map(_estimated, [(scanner, recording)])[0]
        with pytest.raises(kalmems.ExperimentError) as refused:
            pool.map(_refused, [scanner.to_toml().replace("[[recording]]", "[[recordings]]")])
        bad = kalmems.Recording({**recorded, "time_s": recorded["time_s"][::-1]})
        with pytest.raises(kalmems.RecordingError) as unusable:
            pool.map(_estimated, [(scanner, bad)])
    assert np.array_equal(found["UKF"].angle, scanner.estimate(recording)["UKF"].angle)
    assert refused.value.file == "somewhere/experiment.toml" and refused.value.line
    (fatal, *_) = unusable.value.findings
    assert fatal.severity == "fatal" and fatal.kind == "decreasing_time" and fatal.first == 1


def test_errors_of_experiments_name_key_line_and_remedy(scanner: kalmems.Experiment) -> None:
    with pytest.raises(kalmems.ExperimentError, match="did you mean `stiffness`") as error:
        kalmems.Experiment(scanner.to_toml().replace("stiffness =", "stifness ="), "experiment.toml")
    assert error.value.key == "device.shared_scanner.resonator.stifness"
    assert (error.value.file, error.value.line) == ("experiment.toml", 7)
    document = scanner.to_dict()
    document["estimate"]["skip"] = "8 mm"
    with pytest.raises(kalmems.ExperimentError, match="estimate.skip") as error:
        kalmems.Experiment.from_dict(document)
    assert (error.value.key, error.value.line) == ("estimate.skip", None)
    with pytest.raises(kalmems.ExperimentError, match="no single recording") as error:
        scanner.estimate({"training": kalmems.Recording({"time_s": [0.0], "cap_V": [0.0]})})
    assert error.value.key == "recording"


def test_a_dictionary_that_contains_itself_or_is_too_deep_is_an_error(scanner: kalmems.Experiment) -> None:
    itself = scanner.to_dict()
    itself["estimate"] = itself
    deep: object = 1.0
    for _ in range(10_000):
        deep = {"a": [deep]}

    class Numbers:
        def item(self) -> object:
            return Numbers()

    for document in (itself, {"device": deep}, {"device": Numbers()}):
        with pytest.raises(ValueError, match="within one another"):
            kalmems.Experiment.from_dict(document)
    with pytest.raises(ValueError, match="within one another"):
        scanner.replace({"estimate.skip": deep})


def test_experiments_are_values(scanner: kalmems.Experiment) -> None:
    again = kalmems.Experiment.from_dict(scanner.to_dict())
    assert again == scanner and pickle.loads(pickle.dumps(again)) == scanner
    changed = scanner.replace({"estimate.skip": "9 ms", "recording[0].name": "first"})
    assert changed != scanner and changed.to_dict()["estimate"]["skip"] == "9 ms"
    assert changed.to_dict()["recording"][0]["name"] == "first"
    alone = scanner.replace({"recording[0].reference": None, "recording[0].nothing": None, "description": None})
    assert "reference" not in alone.to_dict()["recording"][0] and alone.description is None
    with pytest.raises(ValueError, match="no way to a key"):
        scanner.replace({"a..b": 1})


def test_strict_raises_what_is_warned_of(scanner: kalmems.Experiment) -> None:
    with pytest.raises(kalmems.VerdictError, match="EKF") as error:
        scanner.estimate(strict=True)
    assert error.value.result is not None and error.value.result["EKF"].grade == "doubtful"


def test_a_wrong_unit_is_told_by_the_verdict(scanner: kalmems.Experiment, recorded: dict[str, np.ndarray]) -> None:
    wrong = kalmems.Recording(recorded, units={"cap_V": "mV"})
    with pytest.raises((kalmems.VerdictError, kalmems.EstimationError)):
        scanner.estimate(wrong, strict=True)


def test_what_is_simulated_can_be_estimated_and_identified() -> None:
    simulation = kalmems.Experiment.load(EXAMPLES / "accelerometer/simulation.toml").simulate(seed=3)
    other = kalmems.Experiment.load(EXAMPLES / "accelerometer/simulation.toml").simulate(seed=4)
    assert simulation.recorded.keys() == other.recorded.keys()
    assert any(not np.array_equal(values, other.recorded[name]) for name, values in simulation.recorded.items())
    result = simulation.estimate()
    assert result.trajectories[0].metrics["values"]
    identified = kalmems.Experiment.load(EXAMPLES / "shared_scanner/ring_down.toml").identify()
    stiffness = identified[next(one.name for one in identified if "stiffness" in one.name)]
    assert stiffness.value == pytest.approx(1.10e-4, rel=1e-3)
    assert stiffness.name in identified and stiffness in identified and "stifness" not in identified
    assert identified.experiment.to_dict()["device"]["shared_scanner"]["resonator"]["stiffness"] != "1.1033e-4 N m"


def test_parameters_of_a_device_by_its_equations_have_their_own_names() -> None:
    identified = kalmems.Experiment.load(EXAMPLES / "comb_resonator/experiment.toml").identify()
    names = [parameter.name for parameter in identified]
    assert "k" in names and [parameter.key for parameter in identified] == [f"parameters.{name}" for name in names]
    assert "k" in identified and "parameters.k" in identified and "parameters.j" not in identified
    assert identified["k"] is identified["parameters.k"]


def test_trajectories_become_tables(result: kalmems.Result, tmp_path: Path) -> None:
    ekf, done = result["EKF"], 0
    for name, convert in [("pandas", ekf.to_pandas), ("polars", ekf.to_polars), ("pyarrow", ekf.to_arrow), ("xarray", ekf.to_xarray)]:
        try:
            __import__(name)
        except ImportError:
            continue
        table = convert()
        column = table["angle"] if name == "xarray" else table["angle_rad"]
        assert np.array_equal(np.asarray(column), ekf.angle)
        done += 1
        if name == "pyarrow":
            import pyarrow.parquet

            ekf.to_parquet(tmp_path / "ekf.parquet")
            assert pyarrow.parquet.read_table(tmp_path / "ekf.parquet").equals(table)
    if not done:
        pytest.skip("no library of tables is installed")


def test_other_libraries_take_a_trajectory_without_a_copy(scanner: kalmems.Experiment, recorded: dict[str, np.ndarray]) -> None:
    result = scanner.replace({"recording[0].reference": None}).estimate(kalmems.Recording(recorded))
    ekf, done = result["EKF"], 0
    angle, columns, held = ekf.angle.copy(), list(ekf.columns()), len(_arrow._held)
    # A stream that nobody takes is released with its capsule.
    capsule = ekf.__arrow_c_stream__()
    assert len(_arrow._held) > held
    del capsule
    assert len(_arrow._held) == held
    for name in ("pyarrow", "polars", "duckdb"):
        try:
            module = __import__(name)
        except ImportError:
            continue
        done += 1
        if name == "pyarrow":
            table = module.table(ekf)
            assert table.equals(ekf.to_arrow())
            assert table["angle_rad"].chunk(0).buffers()[1].address == ekf.angle.ctypes.data
        elif name == "polars":
            frame = module.DataFrame(ekf)
            assert frame.columns == columns and np.array_equal(frame["angle_rad"].to_numpy(), angle)
        else:
            ((count, mean),) = module.sql("select count(*), avg(angle_rad) from ekf").fetchall()
            assert count == len(angle) and mean == pytest.approx(angle.mean(), rel=1e-9)
    if not done:
        pytest.skip("no library of tables is installed")
    # What a library has taken of it outlives the result, and is released with what it was made into.
    if "pyarrow" in sys.modules:
        alone = table["angle_rad"]
        del table, ekf, result
        gc.collect()
        assert np.array_equal(alone.to_numpy(), angle)


def test_a_result_is_drawn(result: kalmems.Result) -> None:
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    axes = result.plot()
    assert axes.get_ylabel() == "angle (rad)" and len([line for line in axes.lines if line.get_label() != "reference"]) == 3
    with pytest.raises(KeyError, match="no state is called 'angel'; there are angle, rate"):
        result.plot("angel")


LIBRARIES: dict[str, tuple[str, Callable[[kalmems.Result, Path], object]]] = {
    "matplotlib.pyplot": ("plot", lambda result, _: result.plot()),
    "pandas": ("pandas", lambda result, _: result["EKF"].to_pandas()),
    "polars": ("polars", lambda result, _: result["EKF"].to_polars()),
    "xarray": ("xarray", lambda result, _: result["EKF"].to_xarray()),
    "pyarrow": ("arrow", lambda result, _: result["EKF"].to_arrow()),
    "pyarrow.parquet": ("arrow", lambda result, folder: result["EKF"].to_parquet(folder / "ekf.parquet")),
    "scipy.optimize": ("fit", lambda *_: filters.fit(lambda q: {"F": 1, "H": 1, "Q": q, "R": 1, "x0": 0, "P0": 1}, {"q": 1}, np.ones(9))),
    "scipy.io": ("mat", lambda result, folder: result["EKF"].to_mat(folder / "ekf.mat")),
    "fsspec": ("remote", lambda *_: kalmems.Experiment.load(EXAMPLES / "shared_scanner/experiment.toml").estimate_many("memory://*.csv", "memory://out")),
}


@pytest.mark.parametrize("module", LIBRARIES)
def test_a_library_that_is_not_installed_is_named_with_what_brings_it(
    result: kalmems.Result, module: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    extra, call = LIBRARIES[module]
    # To import it fails then, as if it were not there.
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(ImportError, match=rf"needs {module.split('.')[0]}, .*: pip install 'kalmems\[{extra}\]'"):
        call(result, tmp_path)


def test_the_figures_of_the_report_are_drawn(result: kalmems.Result) -> None:
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    assert {"motion", "nis", "angle_error"} <= set(result.figure_names)
    for name in result.figure_names:
        axes = result.plot(figure=name)
        (figure,) = [one for one in result._figures() if one["id"] == name]
        assert len(axes) == len(figure["panels"])
        for ax, panel in zip(axes, figure["panels"], strict=True):
            kinds = [series["kind"] for series in panel["series"]]
            lines = sum(len(series["data"]) for series in panel["series"] if series["kind"] == "line")
            assert len(ax.lines) == lines + kinds.count("level") + kinds.count("points")
            assert ax.get_legend_handles_labels()[1] == [series["label"] for series in panel["series"] if series["label"]]
        matplotlib.pyplot.close("all")
    # A line of the motion lies on the trajectory that it is drawn from.
    (motion,) = [one for one in result._figures() if one["id"] == "motion"]
    angle = next(panel for panel in motion["panels"] if panel["y"]["label"] == "angle")
    drawn = next(series for series in angle["series"] if series["label"] == "EKF")
    unit = {"rad": 1.0, "deg": np.degrees(1.0)}[angle["y"]["unit"]]
    for time, value in drawn["data"][0][::50]:
        sample = int(np.argmin(np.abs(result["EKF"].time - time)))
        assert value == pytest.approx(unit * result["EKF"].angle[sample], abs=1e-9 * unit)
    with pytest.raises(KeyError, match="'nis'"):
        result.plot(figure="nothing")
    with pytest.raises(ValueError, match="axes of its own"):
        result.plot("angle", figure="nis")
    assert pickle.loads(pickle.dumps(result)).figure_names == result.figure_names


def test_what_is_simulated_and_what_it_is_for_is_drawn() -> None:
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    simulation = kalmems.Experiment.load(EXAMPLES / "shared_scanner/simulation.toml").replace({"simulate.duration": "2 ms"}).simulate()
    axes = simulation.plot()
    assert [ax.get_ylabel() for ax in axes][:2] == ["drive (V)", "cap (V)"]
    assert "samples of time_s" in simulation._repr_html_() and "samples of time_s" in simulation.recording()._repr_html_()
    image = kalmems.image(EXAMPLES / "shared_scanner/image.toml")
    assert image.plot().images[0].get_array().shape == image.values.shape


@pytest.mark.filterwarnings("ignore::kalmems.VerdictWarning")
def test_quantities_of_pint_are_numbers_with_their_units(scanner: kalmems.Experiment, recorded: dict[str, np.ndarray]) -> None:
    pint = pytest.importorskip("pint")
    of = pint.UnitRegistry()
    plain = scanner.estimate(kalmems.Recording(recorded))
    quantities = {
        "time_s": of.Quantity(1e6 * recorded["time_s"], "us"),
        "drive_V": of.Quantity(recorded["drive_V"], "V"),
        "cap_V": of.Quantity(1e3 * recorded["cap_V"], "mV"),
    }
    other = scanner.estimate(kalmems.Recording(quantities))
    assert np.allclose(other["EKF"].angle, plain["EKF"].angle, atol=1e-9)
    changed = scanner.replace(
        {
            "estimate.skip": of.Quantity(8.5, "ms"),
            "device.shared_scanner.resonator.stiffness": of.Quantity(1.1e-4, "N*m/rad"),
            "device.shared_scanner.resonator.damping": of.Quantity(np.float64(5.95e-12), "N*m*s/rad"),
        }
    )
    document = changed.to_dict()
    assert document["estimate"]["skip"] == "8.5 ms"
    assert document["device"]["shared_scanner"]["resonator"]["stiffness"] in ("0.00011 N m/rad", "0.00011 m N/rad")
    with pytest.raises(kalmems.ExperimentError) as error:
        scanner.replace({"estimate.skip": of.Quantity(8, "mm")})
    assert error.value.key == "estimate.skip"


def test_a_wrong_stiffness_is_diagnosed_and_corrected(scanner: kalmems.Experiment, recorded: dict[str, np.ndarray]) -> None:
    found = scanner.diagnose(kalmems.Recording(recorded))
    assert "stiffness" in str(found) and found.experiment is not None
    told = found.experiment.to_dict()["device"]["shared_scanner"]["resonator"]["stiffness"]
    assert float(told.split()[0]) == pytest.approx(1.10e-4, rel=5e-4)
    # The inertia explains it as well: it is written where it is named, by name or by place.
    assert found.corrected(1) == found.experiment or found.corrected(1).to_dict() == found.experiment.to_dict()
    other = found.corrected("resonator.inertia").to_dict()["device"]["shared_scanner"]["resonator"]["inertia"]
    assert float(other.split()[0]) == pytest.approx(1.15e-14 * 1.1033 / 1.10, rel=5e-4)
    with pytest.raises(KeyError, match=r"there are resonator\.stiffness"):
        found.corrected("nothing")


def test_applications_give_arrays_and_figures() -> None:
    calibration = kalmems.calibrate(EXAMPLES / "gyroscope/calibration.toml")
    assert calibration.metrics and "scale factor" in str(calibration)
    assert calibration.figures["allan.svg"].startswith(b"<svg")
    assert calibration.answer[0].startswith("scale factor ") and calibration.answer == calibration.metrics["answer"]
    unit = kalmems.calibrate(EXAMPLES / "inertial_unit/unit.toml")
    assert {record["kind"] for record in unit.metrics["unit_records"]} >= {"positions"} and len(unit.figures) > 2
    assert all(figure.startswith(b"<svg") for figure in unit.figures.values())
    image = kalmems.image(EXAMPLES / "shared_scanner/image.toml")
    assert image.values.ndim == 2 and np.isfinite(image.values).any()
    assert "pixels, of which" in image.answer[0] and str(image).startswith(image.answer[0])
    with pytest.raises(kalmems.ExperimentError):
        kalmems.spectrum(EXAMPLES / "shared_scanner/image.toml")


def many(recorded: dict[str, np.ndarray]) -> dict[str, kalmems.Recording | Path]:
    return {
        "file": EXAMPLES / "shared_scanner/recording.csv",
        "arrays": kalmems.Recording(recorded),
        "once more": kalmems.Recording(recorded),
        "gone": Path("gone.csv"),
        "backwards": kalmems.Recording({**recorded, "time_s": recorded["time_s"][::-1]}),
    }


def test_many_recordings_have_a_file_each_and_one_summary(
    scanner: kalmems.Experiment, recorded: dict[str, np.ndarray], tmp_path: Path
) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    scanner = scanner.replace({"recording[0].reference": None})
    first = scanner.estimate_many(many(recorded), tmp_path / "many")
    assert (first.estimated, first.before, list(first.failures)) == (2, 0, ["backwards", "gone"])
    assert first.same_as == {"once more": "arrays"} and "gone.csv" in first.failures["gone"]
    again = scanner.estimate_many(many(recorded), tmp_path / "many", threads=1)
    assert (again.estimated, again.before) == (0, 2) and again.rows() == first.rows()
    assert [row["recording"] for row in first.rows()] == ["file", "arrays", "once more", "gone", "backwards"]
    # As another reader of Parquet has them, to the last bit.
    result = scanner.estimate(kalmems.Recording(recorded))
    tables = [parquet.read_table(tmp_path / "many/trajectories" / f"{name}.parquet") for name in ("file", "arrays")]
    for table in tables:
        assert table.num_rows == 3 * len(recorded["time_s"])
        own = table.filter(pyarrow_equal(table["filter"], "ekf"))
        for name, values in result["EKF"].columns().items():
            found = own[name].to_numpy()
            assert np.array_equal(np.where(np.isfinite(values), values, np.nan), found.astype(float), equal_nan=True), name
    told = parquet.ParquetFile(tmp_path / "many/trajectories/file.parquet").metadata.row_group(0)
    angle = next(one for one in map(told.column, range(told.num_columns)) if one.path_in_schema == "angle_rad")
    assert angle.compression == "ZSTD" and "BYTE_STREAM_SPLIT" in angle.encodings
    # Another experiment is other work, which is not put over this.
    other = scanner.replace({"estimate.skip": "9 ms"})
    with pytest.raises(kalmems.KalmemsError, match="another batch"):
        other.estimate_many(many(recorded), tmp_path / "many")
    assert other.estimate_many(many(recorded), tmp_path / "many", force=True).estimated == 2


def pyarrow_equal(column: Any, word: str) -> Any:
    import pyarrow.compute

    return pyarrow.compute.equal(column, word)


def test_a_batch_says_that_it_leaves_a_reference_out_and_takes_one_for_each_recording(
    scanner: kalmems.Experiment, tmp_path: Path
) -> None:
    for name in ("recording", "reference"):
        copy(EXAMPLES / f"shared_scanner/{name}.csv", tmp_path / f"{name}.csv")
    files = str(tmp_path / "recording.*")
    with pytest.warns(UserWarning, match="is left out"):
        without = scanner.estimate_many(files, tmp_path / "without")
    assert "errors.angle.rmse_deg" not in without.rows()[0]
    copy(tmp_path / "reference.csv", tmp_path / "truth-recording.csv")
    with_it = scanner.estimate_many([files], tmp_path / "with", reference=str(tmp_path / "truth-{name}.csv"))
    row = with_it.rows()[0]
    alone = scanner.estimate()[row["filter"]]
    assert float(row["errors.angle.rmse_deg"]) == alone.metrics["errors"]["angle"]["rmse_deg"]


def test_paths_with_a_scheme_are_read_and_written(scanner: kalmems.Experiment, tmp_path: Path) -> None:
    fsspec = pytest.importorskip("fsspec")
    system = fsspec.filesystem("memory")
    content = (EXAMPLES / "shared_scanner/recording.csv").read_bytes()
    for name in ("monday", "tuesday"):
        system.pipe_file(f"/scans/{name}.csv", content)
    scanner = scanner.replace({"recording[0].reference": None})
    here = scanner.estimate_many({"monday": EXAMPLES / "shared_scanner/recording.csv"}, tmp_path / "here")
    there = scanner.estimate_many("memory://scans/*.csv", "memory://results/week")
    assert (there.estimated, there.same_as) == (1, {"tuesday": "monday"})
    place = "trajectories/monday.parquet"
    assert system.cat_file(f"/results/week/{place}") == (tmp_path / "here" / place).read_bytes()
    assert [row["grade"] for row in there.rows()] == 2 * [here.rows()[0]["grade"]]
    again = scanner.estimate_many("memory://scans/monday.csv", "memory://results/week")
    assert (again.estimated, again.before, [row["recording"] for row in again.rows()]) == (0, 1, ["monday"])


def test_a_sign_that_nothing_states_is_called_arbitrary() -> None:
    experiment = kalmems.Experiment.load(EXAMPLES / "shared_scanner/true_stiffness.toml")
    stated = experiment.estimate()
    assert stated.segments[0].arbitrary_signs == [] and "arbitrary" not in stated.answer
    unstated = experiment.replace({"estimate.first_peak": None}).estimate()
    assert unstated.segments[0].arbitrary_signs == ["angle"] and unstated.segments[0].arbitrary_half_turns == []
    assert "its sign is arbitrary" in unstated.answer
    assert unstated.segments[0].trajectories[1].metrics["answer"][0]["sign_is_arbitrary"]
