"""Estimates of samples that arrive by MQTT, published by MQTT.

    python mqtt.py STREAM.toml localhost lab/samples lab/motion

A message is text or bytes as `[stream.input]` describes them; an empty one ends the stream. Estimates are published under `lab/motion/FILTER`, what
happened under `lab/motion/event` and `lab/motion/health`, as JSON.
"""

from __future__ import annotations

import json
import queue
import sys
from collections.abc import Iterator
from typing import Any

import kalmems


def follow(client: Any, experiment: str, source: str, target: str) -> None:
    """Estimates what a connected client of paho receives."""
    pieces: queue.Queue[bytes] = queue.Queue()
    client.on_message = lambda client, user, message: pieces.put(message.payload)
    client.subscribe(source)
    client.loop_start()

    def received() -> Iterator[bytes]:
        while piece := pieces.get():
            yield piece

    for one in kalmems.Experiment.load(experiment).stream(received()):
        is_estimate = isinstance(one, kalmems.Estimate)
        topic = f"{target}/{one.filter if is_estimate else one.kind}"
        client.publish(topic, json.dumps({"time_s": one.time, **one.values} if is_estimate else one.data))
    client.loop_stop()


if __name__ == "__main__":
    from paho.mqtt import client as paho

    own = paho.Client(paho.CallbackAPIVersion.VERSION2)
    own.connect(sys.argv[2])
    follow(own, sys.argv[1], *sys.argv[3:])
