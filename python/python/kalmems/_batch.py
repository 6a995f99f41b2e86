"""Many recordings by one experiment, each a file of its own, and one table."""

from __future__ import annotations

import html
import io
import json
import os
import tempfile
import warnings
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

from . import _kalmems, _places, _rows
from ._needed import needed
from ._recording import as_recording
from ._rows import Cell
from ._tables import is_path

if TYPE_CHECKING:
    import pandas
    import polars

    from ._experiment import Experiment

File: TypeAlias = "str | os.PathLike[str]"
Many: TypeAlias = "File | Iterable[File] | Mapping[str, object]"
"""Files, or recordings, tables and files by names of one's own."""


class Batch:
    """What came of many recordings, in a folder."""

    def __init__(self, folder: File, told: dict[str, Any], text: str, estimated: int, before: int) -> None:
        self.folder = folder
        """`summary.csv` has a row for each recording, `results.csv` all figures of all filters, `trajectories/NAME.parquet` the trajectories of one
        recording, and `report.html` shows them."""
        self.estimated = estimated
        """How many were estimated now."""
        self.before = before
        """How many were estimated by an earlier call."""
        self.same_as: dict[str, str] = told["same_as"]
        """Recordings with the content of an earlier one, which share its estimate, and its name."""
        self.failures: dict[str, str] = told["failures"]
        """Those that could not be estimated, and why."""
        self.doubtful: list[str] = told["doubtful"]
        """Those in which the answer to trust is doubtful or worse."""
        self.by_signal: list[dict[str, Any]] = told.get("by_signal", [])
        """Mean NIS of each signal of the trusted filters, with its interval; empty if one signal corrects them."""
        self._text = text

    def _read(self, name: str) -> bytes:
        return _places.read(f"{self.folder}/{name}")

    def rows(self, table: str = "summary") -> list[dict[str, Cell]]:
        """The rows of `summary`, one for each recording, or of `results`: numbers, booleans and texts, and `None` for an empty cell."""
        return _rows.read(self._read(f"{table}.csv").decode())

    def to_pandas(self, table: str = "summary") -> pandas.DataFrame:
        """One of both tables as a `pandas.DataFrame`."""
        found: pandas.DataFrame = needed("pandas", "pandas").read_csv(io.BytesIO(self._read(f"{table}.csv")))
        return found

    def to_polars(self, table: str = "summary") -> polars.DataFrame:
        """One of both tables as a `polars.DataFrame`."""
        found: polars.DataFrame = needed("polars", "polars").read_parquet(self._read(f"{table}.parquet"))
        return found

    def __repr__(self) -> str:
        return f"{self._text}\nin {self.folder}"

    def _repr_html_(self) -> str:
        return f"<pre>{html.escape(repr(self))}</pre>"


def estimate_many(
    experiment: Experiment,
    recordings: Many,
    folder: File,
    of: str | None,
    reference: str | None,
    threads: int | None,
    progress: Callable[[str, int, int], object] | None,
    force: bool,
) -> Batch:
    """See `Experiment.estimate_many`."""
    with tempfile.TemporaryDirectory() as scratch:
        given = _given(recordings, Path(scratch))
        with _places.written(folder) as here:
            told, text, estimated, before, without = _kalmems.estimate_many(
                experiment.to_toml(),
                experiment.path,
                experiment._has_lines,
                given,
                here,
                of,
                reference,
                threads,
                force,
                progress,
            )
    if without:
        warnings.warn(
            "the reference of the experiment is in a file of its own and is left out; name one for each recording by `reference`",
            stacklevel=3,
        )
    return Batch(folder if _places.is_remote(folder) else Path(folder), json.loads(told), text, estimated, before)


def _given(recordings: Many, scratch: Path) -> list[tuple[str, Path | None, _kalmems.Columns | None]]:
    """Each recording by its name: its file, here, or its columns."""
    if isinstance(recordings, Mapping):
        return [
            (str(name), _places.fetched(one, scratch), None) if is_path(one) else (str(name), None, as_recording(one)._native)
            for name, one in recordings.items()
        ]
    files = [recordings] if isinstance(recordings, (str, os.PathLike)) else list(recordings)
    here: list[str] = []
    for file in files:
        here += [str(_places.fetched(one, scratch)) for one in _places.matching(file)]
    return [(name, file, None) for name, file in _kalmems.batch_files(here)]
