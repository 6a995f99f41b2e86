"""Samples that arrive."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import AsyncIterator, Callable, Iterable, Iterator
from typing import Any

import numpy as np
import pytest
from conftest import EXAMPLES

import kalmems

pytestmark = pytest.mark.filterwarnings("ignore::kalmems.VerdictWarning")


@pytest.fixture
def live() -> kalmems.Experiment:
    return kalmems.Experiment.load(EXAMPLES / "shared_scanner/stream.toml")


def pieces() -> Iterator[bytes]:
    content = (EXAMPLES / "shared_scanner/recording.csv").read_bytes()
    for start in range(0, len(content), 5000):
        yield content[start : start + 5000]


def test_a_stream_says_of_a_sample_what_an_estimate_says(live: kalmems.Experiment) -> None:
    stream = live.stream(pieces())
    told = [one for one in stream if isinstance(one, kalmems.Estimate)]
    assert stream.summary is not None and stream.summary["estimated"] > 20_000
    first = told[0].filter
    own = [one for one in told if one.filter == first]
    estimate = live.estimate()[first]
    by_time = dict(zip(estimate.time.tolist(), estimate.angle.tolist(), strict=True))
    shared = [(one.values["angle_rad"], by_time[one.time]) for one in own if one.time in by_time]
    assert len(shared) > 100
    assert np.array_equal(*np.array(shared).T)


def test_a_stream_can_be_asynchronous(live: kalmems.Experiment) -> None:
    async def source() -> AsyncIterator[bytes]:
        for piece in pieces():
            await asyncio.sleep(0)
            yield piece

    async def count() -> int:
        return len([one async for one in live.stream(source())])

    assert asyncio.run(count()) == len(list(live.stream(pieces())))


Columns = dict[str, np.ndarray]


def array(columns: Columns) -> np.ndarray:
    return np.stack([columns[name] for name in ("time_s", "drive_V", "cap_V")], axis=1)


def estimates(told: Iterable[kalmems.Estimate | kalmems.Event]) -> list[kalmems.Estimate]:
    """The estimates of each filter; when those of different filters and events are told depends on the pieces."""
    return sorted((one for one in told if isinstance(one, kalmems.Estimate)), key=lambda one: (one.filter, one.time))


ARRAYS: dict[str, Callable[[Columns], Any]] = {
    "a recording": kalmems.Recording,
    "a mapping with an unused column": lambda columns: {"note": ["x"] * len(columns["time_s"]), **columns},
    "a structured array": lambda columns: np.rec.fromarrays(list(columns.values()), names=list(columns)),
    "an array": array,
    "arrays": lambda columns: np.array_split(array(columns), 7),
    "samples one by one and tables": lambda columns: [*array(columns)[:100], {name: values[100:] for name, values in columns.items()}],
    "bytes as an array": lambda _: [np.frombuffer(piece, np.uint8) for piece in pieces()],
}


@pytest.mark.parametrize("kind", ARRAYS)
def test_arrays_are_streamed_to_the_last_bit(live: kalmems.Experiment, recorded: Columns, kind: str) -> None:
    stream = live.stream(ARRAYS[kind](recorded))
    assert estimates(stream) == estimates(live.stream(pieces()))
    assert stream.summary is not None and stream.summary["estimated"] == len(recorded["time_s"])


def test_arrays_are_streamed_where_an_instrument_sends_frames_and_asynchronously(live: kalmems.Experiment, recorded: Columns) -> None:
    fields = ["u16 sequence", "f64 time_s", "f32 drive_V", "f32 cap_V"]
    framed = live.replace({"stream.input": {"frames": {"sync": "a55a", "fields": fields}}})
    expected = estimates(live.stream(pieces()))

    async def source() -> AsyncIterator[np.ndarray]:
        for part in np.array_split(array(recorded), 3):
            yield part

    async def read(source: Any) -> list[kalmems.Estimate]:
        return estimates([one async for one in live.stream(source)])

    assert estimates(framed.stream(recorded)) == expected == asyncio.run(read(source())) == asyncio.run(read(recorded))


def test_missing_samples_of_arrays_are_missing_in_the_stream(live: kalmems.Experiment, recorded: Columns) -> None:
    missing = np.zeros(len(recorded["cap_V"]), bool)
    missing[[9000, 12_000]] = True
    for signal in (np.ma.MaskedArray(recorded["cap_V"], missing), np.where(missing, np.nan, recorded["cap_V"])):
        stream = live.stream({**recorded, "cap_V": signal})
        told = [one for one in stream if isinstance(one, kalmems.Estimate)]
        by_time = {one.time: one.values["angle_rad"] for one in told if one.filter == "ekf"}
        estimate = live.estimate({**recorded, "cap_V": signal})["EKF"]
        shared = [(by_time[time], angle) for time, angle in zip(estimate.time.tolist(), estimate.angle.tolist(), strict=True) if time in by_time]
        assert len(shared) > 100 and all(here == there for here, there in shared)


@pytest.mark.parametrize(
    ("source", "mend"),
    [
        ("recording.csv", r"is not a path; open it: `experiment.stream\(open\('recording.csv', 'rb'\)\)`"),
        (b"0,1,2\n", "gives pieces of bytes; give a list of them"),
        ([5], "gave int; expected bytes, text, an array with a row for each sample, or a table"),
        (np.zeros((4, 2)), r"shape \(4, 2\); expected 3 columns, time_s, drive_V, cap_V, with a row for each sample"),
        ({"time_s": [0.0]}, r"column `drive_V`: there is no such column \(there are `time_s`\)"),
        ({"time_s": [0.0], "drive_V": [{}], "cap_V": [1.0]}, "column `drive_V` cannot be read: it holds Python objects"),
        ({"time_s": np.zeros(1, "datetime64[ns]"), "drive_V": [0.0], "cap_V": [1.0]}, r"`time_s` holds datetime64\[ns\]; a stream takes numbers"),
        (kalmems.Recording({"time_s": [0.0]}, clock=1e6), "does not read the clock of a recording"),
    ],
)
def test_a_source_that_is_none_is_refused(live: kalmems.Experiment, source: Any, mend: str) -> None:
    with pytest.raises(kalmems.RecordingError, match=mend):
        list(live.stream(source))


class Cable(Exception):
    pass


@pytest.mark.parametrize(("before", "can_be_estimated"), [(b"", False), (b"time_s,drive_V,cap_V\n", False), (next(pieces()), True)])
def test_what_the_source_raises_is_raised(live: kalmems.Experiment, before: bytes, can_be_estimated: bool) -> None:
    def source() -> Iterator[bytes]:
        yield before
        raise Cable

    async def asynchronous() -> AsyncIterator[bytes]:
        yield before
        raise Cable

    async def read() -> None:
        async for _ in live.stream(asynchronous()):
            pass

    with pytest.raises(Cable) as error:
        list(live.stream(source()))
    assert isinstance(error.value.__cause__, kalmems.RecordingError) != can_be_estimated
    with pytest.raises(Cable):
        asyncio.run(read())


def test_a_stream_goes_on_where_it_was_left(live: kalmems.Experiment) -> None:
    whole = list(live.stream(pieces()))
    stream = live.stream(pieces())
    first = next(stream)
    for second in stream:
        break
    assert [first, second, *stream] == whole and stream.summary is not None
    with pytest.raises(StopIteration):
        next(stream)


def test_a_stream_that_nobody_reads_any_more_asks_its_source_no_more(live: kalmems.Experiment) -> None:
    asked = threading.Event()
    ended = threading.Event()

    def endless() -> Iterator[bytes]:
        yield from pieces()
        try:
            while True:
                asked.set()
                yield b""
        finally:
            ended.set()

    for _ in live.stream(endless()):
        if asked.is_set():
            break
    assert ended.wait(10)
