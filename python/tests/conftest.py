"""What the tests share."""

from __future__ import annotations

import csv
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import kalmems

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"


def read(file: Path, labels: tuple[str, ...] = ()) -> dict[str, np.ndarray]:
    """The columns of a text file by Python's own reader; an empty cell is not a number."""
    with file.open(newline="", encoding="utf-8") as lines:
        names, *rows = list(csv.reader(lines))
    columns = {}
    for place, name in enumerate(names):
        cells = [row[place] for row in rows]
        if name in labels:
            columns[name] = np.array(cells)
        else:
            columns[name] = np.array([float(cell) if cell else np.nan for cell in cells])
    return columns


@pytest.fixture
def scanner() -> kalmems.Experiment:
    return kalmems.Experiment.load(EXAMPLES / "shared_scanner/experiment.toml")


@pytest.fixture(scope="session")
def recorded() -> dict[str, np.ndarray]:
    return read(EXAMPLES / "shared_scanner/recording.csv")


@pytest.fixture(scope="session")
def truth() -> dict[str, np.ndarray]:
    return read(EXAMPLES / "shared_scanner/reference.csv")


@pytest.fixture(scope="session")
def columns() -> Callable[..., dict[str, np.ndarray]]:
    return read
