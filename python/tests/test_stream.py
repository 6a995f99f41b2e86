"""Samples that arrive."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import AsyncIterator, Iterator

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
