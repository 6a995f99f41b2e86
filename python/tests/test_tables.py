"""Tables of other libraries, files and what cannot be read, each given to an estimate as it is."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import EXAMPLES

import kalmems

pytestmark = pytest.mark.filterwarnings("ignore::kalmems.VerdictWarning")
Columns = dict[str, np.ndarray]
FILE = EXAMPLES / "shared_scanner/recording.csv"


@pytest.fixture(scope="module")
def alone() -> kalmems.Experiment:
    """The scanner by one filter and without its reference."""
    experiment = kalmems.Experiment.load(EXAMPLES / "shared_scanner/experiment.toml")
    filters = [one for one in experiment.to_dict()["estimate"]["filter"] if one["name"] == "EKF"]
    return experiment.replace({"recording[0].reference": None, "estimate.filter": filters})


@pytest.fixture(scope="module")
def expected(alone: kalmems.Experiment) -> np.ndarray:
    return alone.estimate()["EKF"].angle


def frame(columns: Columns, **further: Any) -> Any:
    return pytest.importorskip("pandas").DataFrame({**columns, **further})


def moments(columns: Columns, zone: str | None = None) -> Any:
    pandas = pytest.importorskip("pandas")
    return pandas.date_range("2026-10-25", periods=len(columns["time_s"]), freq="us", tz=zone)


def without_time(columns: Columns) -> Columns:
    return {name: values for name, values in columns.items() if name != "time_s"}


def dataset(columns: Columns) -> Any:
    xarray = pytest.importorskip("xarray")
    variables = {"drive_V": ("t", columns["drive_V"]), "cap_V": ("t", 1e3 * columns["cap_V"], {"units": "mV"})}
    return xarray.Dataset({**variables, "map_V": (("t", "x"), np.zeros((len(columns["cap_V"]), 2)))}, {"time_s": ("t", columns["time_s"])})


def polars(columns: Columns) -> Any:
    return pytest.importorskip("polars").DataFrame(columns)


def arrow(columns: Columns) -> Any:
    return pytest.importorskip("pyarrow").table(columns)


def duck(columns: Columns) -> Any:
    database = pytest.importorskip("duckdb").connect()
    database.register("recorded", arrow(columns))
    return database.sql("select * from recorded")


def twice(columns: Columns) -> Any:
    """A frame with two unused columns of one name."""
    whole = frame(columns, a_V=0.0, b_V=0.0)
    return whole.rename(columns={"b_V": "a_V"})


# Whether the times are those of a calendar, which are rounded to a nanosecond.
GIVEN: dict[str, tuple[Callable[[Columns], Any], bool]] = {
    "a dictionary of arrays": (lambda columns: columns, False),
    "a dictionary of lists": (lambda columns: {name: values.tolist() for name, values in columns.items()}, False),
    "records of NumPy": (lambda columns: np.rec.fromarrays(list(columns.values()), names=list(columns)), False),
    "the path of a file": (lambda _: FILE, False),
    "the path as a text": (lambda _: str(FILE), False),
    "a path for a role": (lambda _: {"test": FILE}, False),
    "a frame for a role": (lambda columns: {"test": frame(columns)}, False),
    "pandas": (frame, False),
    "pandas, the times as index": (lambda columns: frame(columns).set_index("time_s"), False),
    "pandas, a DatetimeIndex without a name": (lambda columns: frame(without_time(columns)).set_index(moments(columns)), True),
    "pandas, a DatetimeIndex of a zone": (lambda columns: frame(without_time(columns)).set_index(moments(columns, "Europe/Berlin")), True),
    "pandas, a column of a zone": (lambda columns: frame({**columns, "time_s": moments(columns, "Asia/Kolkata")}), True),
    "pandas, an index that counts": (lambda columns: frame(columns).set_index(np.arange(len(columns["time_s"])) + 5), False),
    "pandas, nullable": (lambda columns: frame(columns).astype("Float64"), False),
    "pandas, an unused note": (lambda columns: frame(columns, note=[None, *(len(columns["time_s"]) - 1) * ["x"]]), False),
    "pandas, unused objects": (lambda columns: frame(columns, settings=[{} for _ in columns["time_s"]]), False),
    "pandas, unused categories": (lambda columns: frame(columns, kind="a").astype({"kind": "category"}), False),
    "pandas, unused complex numbers": (lambda columns: frame(columns, spectrum=1j), False),
    "pandas, two unused columns of one name": (twice, False),
    "polars": (polars, False),
    "polars, lazy": (lambda columns: polars(columns).lazy(), False),
    "polars, times of a zone": (lambda columns: pytest.importorskip("polars").from_pandas(frame({**columns, "time_s": moments(columns, "Europe/Berlin")})), True),
    "Arrow": (arrow, False),
    "Arrow, a batch": (lambda columns: arrow(columns).to_batches()[0], False),
    "Arrow, in pieces": (lambda columns: pytest.importorskip("pyarrow").concat_tables([arrow(columns).slice(0, 9), arrow(columns).slice(9)]), False),
    "DuckDB, by the Arrow interface": (duck, False),
    "xarray, units from attributes": (dataset, True),
}


@pytest.mark.parametrize("kind", GIVEN)
def test_a_table_is_estimated_as_it_is(alone: kalmems.Experiment, expected: np.ndarray, recorded: Columns, kind: str) -> None:
    make, is_rounded = GIVEN[kind]
    found = alone.estimate(make(recorded))["EKF"].angle
    assert np.allclose(found, expected, rtol=0, atol=1e-9) if is_rounded else np.array_equal(found, expected)


UNREAD: dict[str, tuple[Any, str]] = {
    "objects": ([{}, {}], "holds Python objects; give numbers or texts"),
    "a ragged list": ([0.0, [1e-6]], "list cannot be converted: .*; give an array of numbers"),
    "two axes": (np.zeros((2, 2)), "has 2 axes; give a column for each series"),
    "complex numbers": (np.zeros(2, complex), "type complex128; give real numbers of at most 64 bits"),
    "days": (np.zeros(2, "datetime64[D]"), r"counts 1 D; give one of s, ms, .*astype\('datetime64\[ns\]'\)"),
}


@pytest.mark.parametrize("kind", UNREAD)
def test_what_cannot_be_read_is_an_error_only_if_it_is_wanted(alone: kalmems.Experiment, kind: str) -> None:
    values, mend = UNREAD[kind]
    recording = kalmems.Recording({"time_s": [0.0, 1e-6], "drive_V": [1.0, 2.0], "cap_V": values})
    assert recording.columns == ("time_s", "drive_V") and "cap_V" not in recording and list(recording.unread) == ["cap_V"]
    assert repr(recording).endswith("; not read: cap_V>") and pickle.loads(pickle.dumps(recording)).unread == recording.unread
    with pytest.raises(kalmems.RecordingError, match=f"^column `cap_V` cannot be read: .*({mend})"):
        alone.estimate(recording)
    with pytest.raises(KeyError, match=f"`cap_V` is not read: .*({mend})"):
        recording["cap_V"]


def test_an_error_of_an_array_of_another_library_is_the_reason() -> None:
    class OnADevice:
        def __array__(self, *_: object, **__: object) -> np.ndarray:
            raise TypeError("copy it to the host first")

    recording = kalmems.Recording({"time_s": [0.0], "cap_V": OnADevice()})
    assert recording.unread == {"cap_V": "OnADevice cannot be converted: copy it to the host first; give an array of numbers"}


@pytest.mark.parametrize(
    ("given", "mend"),
    [
        (5, "expected a mapping of names to arrays"),
        ([{"time_s": 0.0}], "columns of the type list have no names; expected a mapping"),
        (np.zeros((3, 2)), r'an array of 2 axes has no names of columns; name its columns, such as \{"time_s"'),
        ({}, "there is no column that can be read$"),
        ({"a": [None, {}]}, "there is no column that can be read. `a`: it holds Python objects"),
        ("s3://bucket/scan.csv", "is not a file of this machine; copy it here first, or use `estimate_many`"),
        ("nowhere.csv", "there is no file `/.*nowhere.csv`"),
        ({"test": FILE, "cap_V": [0.0]}, "'test' are recordings and the rest are columns"),
    ],
)
def test_what_is_no_table_is_our_error(alone: kalmems.Experiment, given: Any, mend: str) -> None:
    with pytest.raises(kalmems.KalmemsError, match=mend):
        alone.estimate(given)


def test_a_path_is_no_recording_and_a_query_that_fails_is_our_error(alone: kalmems.Experiment, recorded: Columns) -> None:
    with pytest.raises(kalmems.RecordingError, match=r"'a.csv' is a path; .*`experiment.estimate\('a.csv'\)`"):
        kalmems.Recording("a.csv")
    with pytest.raises(kalmems.RecordingError, match="columns of this LazyFrame cannot be read: .*nope"):
        alone.estimate(polars(recorded).lazy().select("nope"))


def test_paths_of_recording_and_reference_are_relative_to_where_the_caller_is(
    scanner: kalmems.Experiment, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    elsewhere = kalmems.Experiment(scanner.to_toml(), tmp_path / "experiment.toml")
    monkeypatch.chdir(FILE.parent)
    found = elsewhere.estimate("recording.csv", reference=Path("reference.csv"))
    assert found["EKF"].metrics["errors"] == scanner.estimate()["EKF"].metrics["errors"]
    stage = kalmems.Experiment.load(EXAMPLES / "micro_stage/experiment.toml")
    with pytest.raises(kalmems.ExperimentError, match="not clear; give a mapping of a name or role to it, of `sweep`") as error:
        stage.estimate("sweep.csv")
    assert error.value.key == "recording"


def test_units_that_are_given_come_before_those_of_attributes(alone: kalmems.Experiment, expected: np.ndarray, recorded: Columns) -> None:
    table = dataset(recorded)
    table["cap_V"].attrs["units"] = "nonsense"
    found = alone.estimate(kalmems.Recording(table, units={"cap_V": "mV"}))["EKF"].angle
    assert np.allclose(found, expected, rtol=0, atol=1e-9)
    with pytest.raises(kalmems.ExperimentError, match="`nonsense` is not a unit"):
        alone.estimate(table)


def test_nulls_are_missing_in_every_library(recorded: Columns) -> None:
    pandas, polars_, pyarrow = (pytest.importorskip(name) for name in ("pandas", "polars", "pyarrow"))
    large = 2**53 + 1
    for values in (pandas.array([1, None, large], dtype="Int64"), polars_.Series([1, None, large]), pyarrow.array([1, None, large])):
        column = kalmems.Recording({"count_1": values})["count_1"]
        assert column.dtype == np.int64 and column.mask.tolist() == [False, True, False] and column[2] == large
    labels = kalmems.Recording({"record": polars_.Series(["a", None]), "time_s": [0.0, 1.0]})["record"]
    assert labels.mask.tolist() == [False, True] and labels[0] == b"a"


def test_tables_are_taken_by_all_work(alone: kalmems.Experiment, recorded: Columns, tmp_path: Path) -> None:
    many = alone.estimate_many({"frame": frame(recorded), "arrays": recorded}, tmp_path / "many")
    assert many.same_as == {"arrays": "frame"} and not many.failures
    assert alone.diagnose(frame(recorded)).told["causes"]
    decay = kalmems.Experiment.load(EXAMPLES / "shared_scanner/ring_down.toml")
    files = {one["name"]: EXAMPLES / "shared_scanner" / one["file"] for one in decay.to_dict()["recording"]}
    assert decay.identify(files).parameters == decay.identify().parameters
