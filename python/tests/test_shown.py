"""What notebooks show, and the rows of tables."""

from __future__ import annotations

import html
import warnings
from pathlib import Path
from typing import Any

import pytest
from conftest import EXAMPLES

import kalmems
from kalmems import _rows


@pytest.fixture(scope="module")
def warned() -> tuple[kalmems.Result, list[str]]:
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        result = kalmems.Experiment.load(EXAMPLES / "shared_scanner/experiment.toml").estimate()
    return result, [str(one.message) for one in caught]


def test_a_doubt_is_one_sentence_and_its_reasons_are_shown_once(warned: tuple[kalmems.Result, list[str]]) -> None:
    result, (message,) = warned
    assert message == "not every answer can be trusted: EKF, UKF; `result.notices` says why"
    shown = result._repr_html_()
    reasons = [notice.text for notice in result.notices if notice.severity == "warning"]
    assert len(reasons) == 4
    for reason in reasons:
        assert reason not in message and shown.count(html.escape(reason.split("`")[0])) == 1
    with pytest.raises(kalmems.VerdictError) as error:
        kalmems.Experiment.load(EXAMPLES / "shared_scanner/experiment.toml").estimate(strict=True)
    assert all(reason in str(error.value) for reason in reasons)


def test_parts_of_a_result_and_what_makes_one_have_html(warned: tuple[kalmems.Result, list[str]]) -> None:
    result, _ = warned
    ekf, segment = result["EKF"], result.segments[0]
    assert repr(ekf) == "<Trajectory 'EKF', filtered: 24001 samples of angle, rate>"
    shown = ekf._repr_html_()
    assert "24001 samples from 0 s to 0.024 s, doubtful" in shown and f"<td>{ekf.angle[-1]:.6g}</td><td>{ekf.angle_sd[-1]:.6g}</td>" in shown
    assert "<td>Model alone</td><td>model</td><td>astray</td><td>–</td>" in segment._repr_html_()
    experiment = kalmems.Experiment.load(EXAMPLES / "micro_stage/experiment.toml")
    shown = experiment._repr_html_()
    assert "<td>bias-on</td><td>bias_on</td><td>bias_on.csv</td><td>drive: drive_V, signal_1A: cap1A_V" in shown
    assert "<p>a &lt; b of <code>x</code></p>" in experiment.replace({"description": "a < b of `x`"})._repr_html_()
    simulation = kalmems.Experiment.load(EXAMPLES / "shared_scanner/simulation.toml")
    study = simulation.study([{"key": "estimate.skip", "values": ["4 ms", "8 ms"]}], repeats=2)
    assert "4 runs of 2 points" in study._repr_html_()


def test_the_report_is_shown_in_a_notebook_in_a_frame_of_its_own(
    warned: tuple[kalmems.Result, list[str]], monkeypatch: pytest.MonkeyPatch
) -> None:
    result, _ = warned
    ipython = pytest.importorskip("IPython")
    with pytest.raises(kalmems.KalmemsError, match=r"no notebook to show the report in; `write\(folder\)`"):
        result.show()
    displayed: list[Any] = []
    monkeypatch.setattr(ipython, "get_ipython", lambda: "a kernel")
    monkeypatch.setattr(ipython.display, "display", displayed.append)
    result.show(height=300)
    (page,) = displayed
    frame = page._repr_html_()
    assert "height:300px" in frame
    before, after = '<iframe srcdoc="', '" style="'
    assert html.unescape(frame[len(before) : frame.rindex(after)]) == result.report_html()


def test_rows_have_numbers_truths_and_none() -> None:
    table = 'recording,error,count,rmse_deg,mirrored,note,empty\r\n1,,3,1,true,4 ms,\r\n02,"two\nlines",,2.5e-3,,5,\r\n'
    assert _rows.read(table) == [
        {"recording": "1", "error": None, "count": 3, "rmse_deg": 1.0, "mirrored": True, "note": "4 ms", "empty": None},
        {"recording": "02", "error": "two\nlines", "count": None, "rmse_deg": 0.0025, "mirrored": None, "note": "5", "empty": None},
    ]
    first = _rows.read(table)[0]
    assert [type(first[name]) for name in ("count", "rmse_deg", "mirrored")] == [int, float, bool]
    assert _rows.read("recording,count\n") == []


def test_rows_of_a_batch_are_those_of_its_recordings(tmp_path: Path) -> None:
    experiment = kalmems.Experiment.load(EXAMPLES / "shared_scanner/experiment.toml").replace({"recording[0].reference": None})
    batch = experiment.estimate_many({"1": EXAMPLES / "shared_scanner/recording.csv", "2": "gone.csv"}, tmp_path / "out")
    one, other = batch.rows()
    assert (one["recording"], one["error"], one["counts.samples"], one["segment.duration_s"]) == ("1", None, 24001, 0.024)
    assert other["counts.samples"] is None and "gone.csv" in str(other["error"])
    assert {row["mirrored"] for row in batch.rows("results")} == {False, None}
