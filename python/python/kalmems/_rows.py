"""The rows of tables that results are written into, with numbers as numbers."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Sequence
from typing import TypeAlias

Cell: TypeAlias = "str | float | bool | None"
"""A text, a number (an `int` if all of its column are), a truth, or `None` for an empty cell."""

_TEXTS = frozenset(
    ("recording", "same_as", "segment", "filter", "estimator", "estimator_name", "grade", "verdict", "error", "trajectories", "file", "sha256")
)
"""Columns of names and texts, which stay texts if they look like numbers."""
_TRUTHS = {"true": True, "false": False}


def read(table: str) -> list[dict[str, Cell]]:
    """The rows of a table in the format CSV."""
    heads, *rows = list(csv.reader(io.StringIO(table, newline="")))
    columns = [_column(head, [row[place] for row in rows]) for place, head in enumerate(heads)]
    return [dict(zip(heads, row, strict=True)) for row in zip(*columns, strict=True)]


def _column(head: str, cells: Sequence[str]) -> list[Cell]:
    """The cells of a column, all of one kind but for the empty ones."""
    if head not in _TEXTS:
        kinds: tuple[Callable[[str], Cell], ...] = (_TRUTHS.__getitem__, int, float)
        for kind in kinds:
            try:
                return [kind(cell) if cell else None for cell in cells]
            except (KeyError, ValueError):
                continue
    return [cell or None for cell in cells]
