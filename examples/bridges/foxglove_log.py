"""Estimates of samples of a file or of standard input, shown by Foxglove.

    python foxglove_log.py STREAM.toml SAMPLES.csv MOTION.mcap
    cat /dev/ttyACM0 | python foxglove_log.py STREAM.toml - -

With a file at the end the estimates are written there, with `-` they are served at ws://127.0.0.1:8765. Each filter is a topic `/motion/FILTER` and
what happened `/motion/event`, with the numbers as JSON that a plot of Foxglove draws.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from typing import Any

import foxglove

import kalmems


def read(file: Any) -> Iterator[bytes]:
    while piece := file.read(65536):
        yield piece


def main(experiment: str, source: str, target: str) -> None:
    server = foxglove.start_server() if target == "-" else None
    writer = None if server else foxglove.open_mcap(target, allow_overwrite=True)
    file = sys.stdin.buffer if source == "-" else open(source, "rb")
    with file:
        for one in kalmems.Experiment.load(experiment).stream(read(file)):
            if isinstance(one, kalmems.Estimate):
                foxglove.log(f"/motion/{one.filter}", {"time_s": one.time, **one.values}, log_time=round(1e9 * one.time))
            else:
                foxglove.log(f"/motion/{one.kind}", one.data)
    if writer:
        writer.close()


if __name__ == "__main__":
    main(*sys.argv[1:])
