"""What `plot` draws: the last cycles or a window, and few points of a long recording."""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

import kalmems

matplotlib = pytest.importorskip("matplotlib")
matplotlib.use("Agg")

MOTION_HZ = 1e3


@pytest.fixture(autouse=True)
def _closed() -> Iterator[None]:
    yield
    matplotlib.pyplot.close("all")


def made(rows: int, motion_hz: float | None = MOTION_HZ, start: float = 0.0, has_reference: bool = False) -> kalmems.Segment:
    """A segment of one filter and a model, sampled at 100 kHz."""
    times = start + np.arange(rows) * 1e-5
    angle = np.sin(2 * np.pi * MOTION_HZ * times)
    nothing = np.zeros(rows)

    def trajectory(name: str, sd: np.ndarray | None) -> kalmems.Trajectory:
        states = {"angle": kalmems.State("angle", "rad", angle, sd)}
        signals = (nothing, nothing, nothing, nothing, nothing, "V", nothing, {}, {})
        return kalmems.Trajectory(name.lower(), name, "filtered", times, states, *signals)

    segment = kalmems.Segment("", "", 1, "cap_V", 0.0, {"motion_hz": motion_hz}, [trajectory("EKF", nothing + 0.1), trajectory("Model", None)])
    if has_reference:
        segment.references["angle"] = kalmems.Reference(times, angle + 0.5)
    return segment


def result(*segments: kalmems.Segment) -> kalmems.Result:
    state: dict[str, Any] = dict.fromkeys(("metrics", "notices", "sources", "tables", "answers", "summary", "toml"))
    return kalmems.Result({**state, "segments": list(segments)})


def drawn(ax: Any) -> tuple[np.ndarray, np.ndarray]:
    return ax.lines[0].get_xdata(), ax.lines[0].get_ydata()


def test_the_last_four_cycles_are_drawn_and_without_a_frequency_the_last_2000_samples() -> None:
    one = made(10_000)
    times, angles = drawn(result(one).plot())
    assert np.array_equal(times, one["EKF"].time[-401:]) and np.array_equal(angles, one["EKF"].angle[-401:])
    assert len(drawn(result(made(10_000, motion_hz=None)).plot())[0]) == 2000
    # The last cycles of the whole are those of the last segment.
    assert drawn(result(made(500), made(500, start=1.0)).plot())[0][0] > 1.0


def test_a_window_is_drawn_of_all_segments() -> None:
    both = result(made(1000), made(1000, start=1.0))
    ax = both.plot(window=(0.002, 1.003))
    assert len(ax.lines) == 4 and len(ax.get_legend_handles_labels()[1]) == 2
    assert ax.lines[0].get_xdata()[0] == pytest.approx(0.002) and ax.lines[2].get_xdata()[-1] == pytest.approx(1.003)
    assert len(both.plot(window=(None, 0.5)).lines) == 2
    assert [len(line.get_xdata()) for line in both.plot(window=(None, None)).lines] == 4 * [1000]
    with pytest.raises(ValueError, match=r"no sample lies in the window of \(5, 6\) s; the segments cover 0 s to 0.00999 s, 1 s"):
        both.plot(window=(5, 6))
    with pytest.raises(ValueError, match="leave `state`, `window` and `ax` out"):
        both.plot(figure="nis", window=(0, 1))


def test_the_reference_and_the_claim_are_drawn() -> None:
    one = made(10_000, has_reference=True)
    ax = result(one).plot(band=3)
    assert ax.get_legend_handles_labels()[1] == ["EKF", "Model", "reference"]
    assert np.array_equal(ax.lines[2].get_ydata(), one.references["angle"].values[-401:])
    (claim,) = ax.collections
    corners = claim.get_paths()[0].vertices
    assert corners[:, 1].max() == pytest.approx(1.3) and corners[:, 1].min() == pytest.approx(-1.3)
    assert len(result(one).plot(band=0).collections) == 0


def test_few_points_of_a_long_recording_have_its_extremes() -> None:
    one = made(1_000_000)
    angle = one["EKF"].angle
    angle[123_456], angle[765_432], angle[500_000] = 7.0, -7.0, np.nan
    ax = result(one).plot(window=(None, None))
    times, values = drawn(ax)
    assert len(times) <= 4 * 800 and np.all(np.diff(times) >= 0)
    assert (times[0], times[-1]) == (one["EKF"].time[0], one["EKF"].time[-1])
    assert np.nanmax(values) == 7.0 and np.nanmin(values) == -7.0
    width = one["EKF"].time[-1] / ax.get_window_extent().width
    assert abs(times[np.nanargmax(values)] - one["EKF"].time[123_456]) <= width
    corners = ax.collections[0].get_paths()[0].vertices
    assert corners[:, 1].max() == pytest.approx(7.2) and len(corners) < 10_000


def test_five_million_samples_are_drawn_in_0_3_s() -> None:
    long = result(made(5_000_000, has_reference=True))

    def took(window: tuple[float | None, float | None] | None, is_drawn: bool) -> float:
        begun = time.process_time()
        ax = long.plot(window=window)
        if is_drawn:
            ax.figure.canvas.draw()
        return time.process_time() - begun

    # The first picture of a process reads matplotlib's fonts. The fastest of three is taken: others may use the same cores.
    took((0.0, 0.001), is_drawn=True)
    assert min(took(None, is_drawn=True) for _ in range(3)) < 0.3
    # How long matplotlib paints a line that fills its axes depends on the axes, not on the recording.
    assert min(took((None, None), is_drawn=False) for _ in range(3)) < 0.3
