"""Functions for the Python Node of LabVIEW (2018 and newer): open, push, poll and close, with strings and arrays of numbers alone.

Open a session with the Python in which kalmems is installed, and call these functions of this file. `push` takes a two-dimensional array with a row for
each sample, of the columns of `[stream.input.text]`; `poll` gives one with a row for each estimate of a filter, the time first.
"""

from __future__ import annotations

import queue
import threading
from collections.abc import Iterator
from typing import Any

import numpy as np

import kalmems

_streams: dict[int, "_Open"] = {}


class _Open:
    def __init__(self, experiment: str) -> None:
        self.pieces: queue.Queue[np.ndarray | None] = queue.Queue(64)
        self.found: queue.Queue[Any] = queue.Queue()
        stream = kalmems.Experiment.load(experiment).stream(self._received())
        self.thread = threading.Thread(target=self._follow, args=(stream,), daemon=True)
        self.thread.start()

    def _received(self) -> Iterator[np.ndarray]:
        while (piece := self.pieces.get()) is not None:
            yield piece

    def _follow(self, stream: kalmems.Stream) -> None:
        try:
            for one in stream:
                self.found.put(one)
        except Exception as error:  # noqa: BLE001 - raised where the node polls
            self.found.put(error)


def open(experiment: str) -> int:
    """Begins; the number of the stream."""
    number = 1 + max(_streams, default=0)
    _streams[number] = _Open(experiment)
    return number


def push(number: int, samples: list[list[float]]) -> int:
    """Hands samples over; how many pieces wait."""
    one = _streams[number]
    while True:
        try:
            one.pieces.put(np.array(samples, dtype=float), timeout=1)
            return one.pieces.qsize()
        except queue.Full:
            if not one.thread.is_alive():
                raise RuntimeError("the stream has ended; poll it for the reason") from None


def poll(number: int, filter: str) -> list[list[float]]:
    """The estimates of a filter since the last poll: the time in s, then each number in the order of the command."""
    rows = []
    while True:
        try:
            one = _streams[number].found.get_nowait()
        except queue.Empty:
            return rows
        if isinstance(one, Exception):
            raise one
        if isinstance(one, kalmems.Estimate) and one.filter == filter:
            rows.append([one.time, *(float("nan") if value is None else value for value in one.values.values())])


def close(number: int, filter: str) -> list[list[float]]:
    """Waits for the end; the estimates that are left."""
    _streams[number].pieces.put(None)
    _streams[number].thread.join()
    rows = poll(number, filter)
    del _streams[number]
    return rows
