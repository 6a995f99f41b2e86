"""Estimates of a stream of the lab streaming layer, as another stream.

    python lsl.py STREAM.toml NAME

The stream of this name has a channel for each column of `[stream.input.text]` but the times, which are those of the layer. Its estimates are the
stream `kalmems`, with a channel for each number of the first filter; both end after a second without samples.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from typing import Any

import numpy as np
import pylsl

import kalmems


def received(inlet: Any, patience_s: float) -> Iterator[np.ndarray]:
    """Rows of times from the first sample on and of the channels."""
    first = None
    while True:
        samples, times = inlet.pull_chunk(timeout=patience_s)
        if not times:
            return
        first = times[0] if first is None else first
        yield np.column_stack([np.array(times) - first, samples])


def main(experiment: str, name: str, patience_s: float = 1.0) -> None:
    (found, *_) = pylsl.resolve_byprop("name", name, timeout=10)
    inlet, outlet, of = pylsl.StreamInlet(found), None, ""
    for one in kalmems.Experiment.load(experiment).stream(received(inlet, patience_s)):
        if not isinstance(one, kalmems.Estimate):
            continue
        if outlet is None:
            of = one.filter
            outlet = pylsl.StreamOutlet(pylsl.StreamInfo("kalmems", "motion", len(one.values), pylsl.IRREGULAR_RATE, "double64", f"kalmems {name}"))
        if one.filter == of:
            outlet.push_sample([np.nan if value is None else value for value in one.values.values()])


if __name__ == "__main__":
    main(*sys.argv[1:])
