"""Estimates of samples that a ZeroMQ socket publishes, published by another one.

    python zeromq.py STREAM.toml tcp://127.0.0.1:5555 tcp://127.0.0.1:5556

A message is text or bytes as `[stream.input]` describes them; an empty one ends the stream. Each estimate and event is published as JSON, with the
filter, `event` or `health` as its first part, to which a subscriber can subscribe.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from typing import Any

import zmq

import kalmems


def received(socket: Any) -> Iterator[bytes]:
    while piece := socket.recv():
        yield piece


def main(experiment: str, source: str, target: str) -> None:
    context = zmq.Context.instance()
    with context.socket(zmq.SUB) as samples, context.socket(zmq.PUB) as estimates:
        samples.connect(source)
        samples.subscribe(b"")
        estimates.bind(target)
        for one in kalmems.Experiment.load(experiment).stream(received(samples)):
            if isinstance(one, kalmems.Estimate):
                estimates.send_multipart([one.filter.encode(), json.dumps({"time_s": one.time, **one.values}).encode()])
            else:
                estimates.send_multipart([one.kind.encode(), json.dumps(one.data).encode()])


if __name__ == "__main__":
    main(*sys.argv[1:])
