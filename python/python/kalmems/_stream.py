"""Estimates of samples while they arrive."""

from __future__ import annotations

import asyncio
import json
import os
import threading
import weakref
from collections import deque
from collections.abc import AsyncIterable, AsyncIterator, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

from . import _kalmems, _samples

if TYPE_CHECKING:
    from ._experiment import Experiment

Piece: TypeAlias = "bytes | bytearray | memoryview | str | _samples.Samples"
"""Some samples: bytes or text as an instrument sends them, an array, or a table."""
Source: TypeAlias = "Iterable[Piece] | AsyncIterable[Piece] | _samples.Samples"
"""Whatever gives pieces, or is one."""


@dataclass(frozen=True)
class Estimate:
    """What a filter says of a sample, in SI."""

    filter: str
    """The filter as a key, such as `ekf`."""
    time: float
    values: dict[str, float | None] = field(default_factory=dict)
    """Mean and standard deviation of each state by the names of the columns, such as `angle_rad` and `angle_sd_rad`."""


@dataclass(frozen=True)
class Event:
    """Something that happened to the stream or the motion: an event or a line on the stream's health, as `kalmems stream` writes it."""

    kind: str
    """`event` or `health`."""
    data: dict[str, Any] = field(default_factory=dict)
    """What happened, such as `{"event": "zero_phase", "of": "angle", "time_s": 0.0239, …}`."""


class Stream:
    """An iterator over estimates and events of samples that arrive.

    `source` gives the samples in pieces of bytes or text, in the format that the table `stream` of the experiment describes; it is asked on a
    thread of its own. With `async for` it may be asynchronous. A piece may be an array as well, with a row for each sample and the columns of
    `stream.input.text`, or a table with columns of these names; and so may be `source` itself. Numbers become text to their last digit, so
    that the estimates are those of the arrays; what is not a number is missing. `summary` is what came of the stream, once it has ended. After a loop was left,
    `next` or another loop goes on from there; the work ends with `close`, or when nothing refers to the stream any more.
    """

    def __init__(self, experiment: Experiment, source: Source, state: str | os.PathLike[str] | None) -> None:
        kept = None if state is None else Path(state)
        _samples.check(source)
        self._columns, is_text = _samples.columns(experiment)
        if _samples.is_whole(source):
            source = [source]
            if not is_text and self._columns:
                # Arrays come as text, whatever an instrument would send.
                experiment = experiment.replace({"stream.input": {"text": {"columns": self._columns}}})
        self._native = _kalmems.Stream(experiment.to_toml(), experiment.path, kept)
        self._source = source
        self._names: dict[str, list[str]] = {}
        self._rest = b""
        self._ready: deque[Estimate | Event] = deque()
        self._failed: list[BaseException] = []
        self._is_begun = self._is_ended = False
        self.summary: dict[str, Any] | None = None
        weakref.finalize(self, self._native.stop)

    def close(self) -> None:
        """Stops the work where it is."""
        self._native.stop()

    def __iter__(self) -> Stream:
        return self

    def __next__(self) -> Estimate | Event:
        if not self._is_begun:
            if not isinstance(self._source, Iterable):
                raise TypeError("an asynchronous source needs `async for`")
            # The thread has no reference to this object, so that a stream that nobody reads any more ends.
            threading.Thread(target=_feed, args=(self._native, self._source, self._columns, self._failed), daemon=True).start()
            self._is_begun = True
        while not self._ready and not self._is_ended:
            try:
                lines = self._native.lines(True)
            except BaseException:
                self._native.stop()
                raise
            if lines:
                self._ready.extend(self._parsed(lines))
            else:
                self._end()
        if not self._ready:
            raise StopIteration
        return self._ready.popleft()

    async def __aiter__(self) -> AsyncIterator[Estimate | Event]:
        if isinstance(self._source, AsyncIterable):
            feeding = asyncio.create_task(_feed_asynchronously(self._native, self._source, self._columns, self._failed))
        else:
            feeding = asyncio.create_task(asyncio.to_thread(_feed, self._native, self._source, self._columns, self._failed))
        try:
            while lines := await asyncio.to_thread(self._native.lines, True):
                for one in self._parsed(lines):
                    yield one
            self._end()
        finally:
            self._native.stop()
            feeding.cancel()

    def _end(self) -> None:
        self._is_ended = True
        try:
            told = self._native.summary()
        except Exception as error:
            if self._failed:
                raise self._failed[0] from error
            raise
        self.summary = None if told is None else json.loads(told)
        if self._failed:
            raise self._failed[0]

    def _parsed(self, lines: bytes) -> Iterator[Estimate | Event]:
        *whole, self._rest = (self._rest + lines).split(b"\n")
        for line in whole:
            text = line.decode()
            head, _, rest = text.partition(",")
            if text.startswith("# "):
                names = text[2:].split(",")
                if len(names) > 1:
                    self._names[names[0]] = names[1:]
            elif head in ("event", "health"):
                yield Event(head, json.loads(rest))
            else:
                time, *cells = rest.split(",")
                names = self._names.get(head, [])[1:]
                values = {name: float(cell) if cell else None for name, cell in zip(names, cells, strict=False)}
                yield Estimate(head, float(time), values)


def _feed(native: _kalmems.Stream, source: Iterable[Piece], columns: Sequence[str], failed: list[BaseException]) -> None:
    try:
        for piece in _samples.encoded(source, columns):
            if not native.feed(piece):
                break
    except BaseException as error:
        failed.append(error)
    native.close()


async def _feed_asynchronously(
    native: _kalmems.Stream, source: AsyncIterable[Piece], columns: Sequence[str], failed: list[BaseException]
) -> None:
    try:
        async for piece in source:
            for part in _samples.encoded_piece(piece, columns):
                if not await asyncio.to_thread(native.feed, part):
                    return
    except Exception as error:
        failed.append(error)
    native.close()
