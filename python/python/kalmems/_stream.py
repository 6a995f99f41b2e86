"""Estimates of samples while they arrive."""

from __future__ import annotations

import asyncio
import json
import os
import threading
from collections.abc import AsyncIterable, AsyncIterator, Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from . import _kalmems

if TYPE_CHECKING:
    from ._experiment import Experiment


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
    thread of its own. With `async for` it may be asynchronous. `summary` is what came of the stream, once it has ended.
    """

    def __init__(
        self, experiment: Experiment, source: Iterable[bytes | str] | AsyncIterable[bytes | str], state: str | os.PathLike[str] | None
    ) -> None:
        kept = None if state is None else Path(state)
        self._native = _kalmems.Stream(experiment.to_toml(), experiment.path, kept)
        self._source = source
        self._names: dict[str, list[str]] = {}
        self._rest = b""
        self._failed: BaseException | None = None
        self.summary: dict[str, Any] | None = None

    def close(self) -> None:
        """Stops the work where it is."""
        self._native.stop()

    def __iter__(self) -> Iterator[Estimate | Event]:
        if not isinstance(self._source, Iterable):
            raise TypeError("an asynchronous source needs `async for`")
        threading.Thread(target=self._feed, args=(self._source,), daemon=True).start()
        try:
            while lines := self._native.lines(True):
                yield from self._parsed(lines)
            self._end()
        finally:
            self._native.stop()

    async def __aiter__(self) -> AsyncIterator[Estimate | Event]:
        if isinstance(self._source, AsyncIterable):
            feeding = asyncio.create_task(self._feed_asynchronously(self._source))
        else:
            feeding = asyncio.create_task(asyncio.to_thread(self._feed, self._source))
        try:
            while lines := await asyncio.to_thread(self._native.lines, True):
                for one in self._parsed(lines):
                    yield one
            self._end()
        finally:
            self._native.stop()
            feeding.cancel()

    def _feed(self, source: Iterable[bytes | str]) -> None:
        try:
            for piece in source:
                if not self._native.feed(piece.encode() if isinstance(piece, str) else bytes(piece)):
                    break
        except BaseException as error:
            self._failed = error
        self._native.close()

    async def _feed_asynchronously(self, source: AsyncIterable[bytes | str]) -> None:
        try:
            async for piece in source:
                taken = await asyncio.to_thread(self._native.feed, piece.encode() if isinstance(piece, str) else bytes(piece))
                if not taken:
                    break
        except Exception as error:
            self._failed = error
        self._native.close()

    def _end(self) -> None:
        told = self._native.summary()
        self.summary = None if told is None else json.loads(told)
        if self._failed is not None:
            raise self._failed

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
