"""Studies: an experiment again and again, in parts that run anywhere."""

from __future__ import annotations

import html
import json
import os
import tempfile
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from . import _html, _kalmems, _rows
from ._errors import KalmemsError
from ._executor import finished
from ._needed import needed
from ._rows import Cell

if TYPE_CHECKING:
    import pandas
    import polars

    from ._experiment import Experiment

PARTS = 32
"""Parts of a study on an executor where their number is left out: so many that no worker waits long for the last part of another, and so few
that the fixed cost of a part does not matter."""

Progress: TypeAlias = "Callable[[str, int, int], object] | None"


class Study:
    """A study of an experiment: its keys vary over grids, lists or at random, and each point is run with noise of its own.

    The keys of `document` are those of a study file but for `experiment`. It can be pickled, and so can its parts: what a part computes follows from
    the study alone, wherever it runs.
    """

    def __init__(self, experiment: Experiment, document: Mapping[str, object]) -> None:
        study = {"name": experiment.name, **document, "experiment": experiment.path.name}
        self._texts = (_kalmems.to_toml(study), experiment.to_toml(), experiment.path.absolute())
        self.name, self.points, self.runs = _kalmems.study_check(self._texts)

    def parts(self, count: int) -> list[Part]:
        """As many parts of about as many runs each."""
        if count < 1:
            raise KalmemsError(f"a study has at least one part, and {count} are asked for; give as many as there are workers, or more")
        return [Part(self, part, count) for part in range(1, count + 1)]

    def run(
        self,
        folder: str | os.PathLike[str],
        *,
        threads: int | None = None,
        executor: Any = None,
        parts: int | None = None,
        deadline: float | None = None,
        progress: Progress = None,
        force: bool = False,
    ) -> StudyResult:
        """Runs the study and writes its results into a folder; what is finished stays in a journal beside it, and the same call goes on from there.

        With an `executor` that has `submit`, such as one of `concurrent.futures` or a client of Dask distributed, its workers run as many `parts`,
        each on one thread: 32 where that is left out; 16 or more for each worker keep all of them busy to the end. The results are those of a run
        here to the last byte. Where no part is finished for `deadline` s, those that are missing are given out again, since a worker may hang;
        whichever comes first counts, and both say the same. Left out, that is ten times the longest that one was waited for, and at least a minute.
        `progress` hears how many parts are finished.
        """
        folder = Path(folder)
        if executor is None:
            journal = _kalmems.study_run(self._texts, folder, 1, 1, threads, progress)
            return self._merged([journal], folder, force)
        if not hasattr(executor, "submit"):
            expected = "an object with `submit`, such as `concurrent.futures.ProcessPoolExecutor()`"
            raise KalmemsError(f"the executor is of the type {type(executor).__name__}; expected {expected}")
        count = min(parts if parts is not None else PARTS, self.runs)
        return self.merge(finished(executor, self.parts(count), deadline, progress), folder, force=force)

    def merge(
        self, parts: Iterable[bytes | str | os.PathLike[str]], folder: str | os.PathLike[str], *, force: bool = False
    ) -> StudyResult:
        """Joins what all parts gave, bytes or journals, and writes the results into a folder. A part that was run twice counts once."""
        parts = list(parts)
        if not parts:
            raise KalmemsError("there are no parts to merge; give what `run` of each part of `study.parts(count)` returned")
        with tempfile.TemporaryDirectory() as place:
            journals = []
            for number, part in enumerate(parts):
                if isinstance(part, bytes):
                    journal = Path(place) / f"{number}.journal"
                    journal.write_bytes(part)
                    journals.append(journal)
                else:
                    journals.append(Path(part))
            return self._merged(journals, Path(folder), force)

    def _merged(self, journals: Sequence[Path], folder: Path, force: bool) -> StudyResult:
        told, text, figures, target = _kalmems.study_merge(self._texts, list(journals), folder, force)
        return StudyResult(Path(target), json.loads(told), text, json.loads(figures))

    def __repr__(self) -> str:
        return f"<Study {self.name!r}: {self.runs} runs of {self.points} points>"

    def _repr_html_(self) -> str:
        return f"{_html.heading(self.name)}\n" + _html.paragraph(f"Study: {self.runs} runs of {self.points} points")


class Part:
    """A part of a study."""

    def __init__(self, study: Study, part: int, of: int) -> None:
        self.study, self.part, self.of = study, part, of

    def run(self, folder: str | os.PathLike[str] | None = None, *, threads: int = 1) -> bytes:
        """Runs it; its journal, for `Study.merge`. With a folder that all workers see, a part that was broken off goes on where it was."""
        if folder is not None:
            return self._run(Path(folder), threads)
        with tempfile.TemporaryDirectory() as place:
            return self._run(Path(place), threads)

    def _run(self, folder: Path, threads: int) -> bytes:
        texts, out = self.study._texts, folder / self.study.name
        return Path(_kalmems.study_run(texts, out, self.part, self.of, threads)).read_bytes()

    def __repr__(self) -> str:
        return f"<part {self.part} of {self.of} of {self.study!r}>"


class StudyResult:
    """What came of a study, in a folder."""

    def __init__(self, folder: Path, summary: dict[str, Any], text: str, figures: list[dict[str, Any]]) -> None:
        self._figures = figures
        self.folder = folder
        """`results.csv` has all figures of all runs, `report.html` shows them."""
        self.summary = summary
        self._text = text

    def rows(self) -> list[dict[str, Cell]]:
        """The rows of `results.csv`: numbers, booleans and texts, and `None` for an empty cell."""
        return _rows.read((self.folder / "results.csv").read_bytes().decode())

    def to_pandas(self) -> pandas.DataFrame:
        """All figures of all runs as a `pandas.DataFrame`."""
        table: pandas.DataFrame = needed("pandas", "pandas").read_csv(self.folder / "results.csv")
        return table

    def to_polars(self) -> polars.DataFrame:
        """All figures of all runs as a `polars.DataFrame`."""
        table: polars.DataFrame = needed("polars", "polars").read_csv(self.folder / "results.csv", infer_schema_length=None)
        return table

    @property
    def figure_names(self) -> list[str]:
        """The figures of the report, which `figures=` of the study asked for."""
        return [str(figure["id"]) for figure in self._figures]

    def plot(self, figure: str | None = None) -> NDArray[np.object_]:
        """Draws a figure of the report, the first where no name is given (needs matplotlib); its axes, from top to bottom."""
        from . import _plot

        return _plot.draw(_plot.chosen(self._figures, figure if figure is not None else next(iter(self.figure_names), "")))

    def __repr__(self) -> str:
        return f"{self._text}\nin {self.folder}"

    def _repr_html_(self) -> str:
        return f"<pre>{html.escape(repr(self))}</pre>"
