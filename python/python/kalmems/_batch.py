"""Many recordings by one experiment, each a file of its own, and one summary."""

from __future__ import annotations

import csv
import hashlib
import json
import os
import warnings
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ._errors import KalmemsError, VerdictWarning
from ._recording import Recording

if TYPE_CHECKING:
    from ._experiment import Experiment
    from ._result import Result


@dataclass(frozen=True)
class Batch:
    """What came of many recordings."""

    folder: Path
    """`summary.csv` has a row for each recording and filter, `NAME.parquet` the trajectories of one recording."""
    estimated: int
    """How many were estimated now."""
    before: int
    """How many were there already."""
    failures: dict[str, str]
    """Those that could not be estimated, and why."""

    def rows(self) -> list[dict[str, str]]:
        """The rows of the summary."""
        with (self.folder / "summary.csv").open(newline="", encoding="utf-8") as lines:
            return list(csv.DictReader(lines))


def estimate_many(
    experiment: Experiment,
    recordings: Mapping[str, Recording | str | os.PathLike[str]] | Iterable[str | os.PathLike[str]],
    folder: str | os.PathLike[str],
    of: str | None,
) -> Batch:
    """See `Experiment.estimate_many`."""
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    if not isinstance(recordings, Mapping):
        recordings = _named(recordings)
    text = experiment.to_toml()
    estimated, before, failures, summaries = 0, 0, {}, []
    for name, recording in recordings.items():
        told = folder / f"{name}.json"
        key = _key(text, recording)
        kept = json.loads(told.read_text(encoding="utf-8")) if told.exists() else {}
        if kept.get("key") == key and (folder / f"{name}.parquet").exists():
            before += 1
        else:
            try:
                with warnings.catch_warnings():
                    # The summary says it of each.
                    warnings.simplefilter("ignore", VerdictWarning)
                    result = _estimated(experiment, recording, of)
            except (KalmemsError, OSError) as error:
                failures[name] = str(error)
                continue
            kept = {"key": key, "rows": _rows(name, result)}
            _write(result, folder / f"{name}.parquet")
            _whole(told, json.dumps(kept))
            estimated += 1
        summaries += kept["rows"]
    columns = list(dict.fromkeys(column for row in summaries for column in row))
    lines = [columns, *([row.get(column, "") for column in columns] for row in summaries)]
    place = folder / "summary.csv.part"
    with place.open("w", newline="", encoding="utf-8") as file:
        csv.writer(file, lineterminator="\n").writerows(lines)
    place.replace(folder / "summary.csv")
    return Batch(folder, estimated, before, failures)


def _named(files: Iterable[str | os.PathLike[str]]) -> dict[str, str | os.PathLike[str]]:
    """Files by their names without folder and ending; refused where two have one."""
    named: dict[str, str | os.PathLike[str]] = {}
    for file in files:
        name = Path(file).stem
        if name in named:
            raise ValueError(f"`{named[name]}` and `{file}` have one name; give a mapping of names of your own to the files")
        named[name] = file
    return named


def _key(text: str, recording: Recording | str | os.PathLike[str]) -> str:
    """What tells this work from other: the experiment and the numbers."""
    if isinstance(recording, Recording):
        said = [recording.sha256, repr((recording._units, recording._segments, recording._clock))]
    else:
        try:
            with Path(recording).open("rb") as file:
                digest = hashlib.sha256()
                while piece := file.read(1 << 20):
                    digest.update(piece)
            said = [digest.hexdigest()]
        except OSError:
            # It is told by who reads it.
            said = ["none"]
    return hashlib.sha256("\n".join([text, *said]).encode()).hexdigest()


def _estimated(experiment: Experiment, recording: Recording | str | os.PathLike[str], of: str | None) -> Result:
    if isinstance(recording, Recording):
        return experiment.estimate(recording if of is None else {of: recording})
    described = experiment.to_dict()["recording"]
    names = [number for number, one in enumerate(described) if of is None or of in (one.get("name"), one.get("role"))]
    if len(names) != 1:
        raise ValueError(f"which of the {len(described)} recordings of the experiment is meant is not clear; say its name or role by `of`")
    return experiment.replace({f"recording[{names[0]}].file": str(Path(recording).absolute())}).estimate()


def _rows(name: str, result: Result) -> list[dict[str, Any]]:
    rows = []
    for segment in result.segments:
        for one in segment:
            consistency = one.metrics.get("consistency") or {}
            row = {
                "recording": name,
                "segment": segment.label,
                "stretch": segment.stretch,
                "filter": one.name,
                "grade": one.grade or "",
                "verdict": one.verdict,
                "mean_nis": consistency.get("mean_nis", ""),
                "motion_Hz": segment.metrics.get("motion_hz", ""),
                "samples": one.metrics["counts"]["samples"],
                "without_signal": one.metrics["counts"]["without_signal"],
                "sha256": result.sources[0][1],
            }
            errors = one.metrics.get("errors")
            if errors:
                row["angle_rmse_deg"] = errors["angle"]["rmse_deg"]
            rows.append(row)
    return rows


def _write(result: Result, path: Path) -> None:
    """All trajectories of a result in one table, with segment and filter in front."""
    import pyarrow
    import pyarrow.parquet

    tables = []
    for segment in result.segments:
        for one in segment:
            table = one.to_arrow()
            for place, (column, value) in enumerate(
                [("segment", segment.label), ("stretch", str(segment.stretch)), ("filter", one.key)]
            ):
                values = pyarrow.array([value] * len(one)).dictionary_encode()
                table = table.add_column(place, column, values)
            tables.append(table)
    table = pyarrow.concat_tables(tables, promote_options="default")
    numbers = [field.name for field in table.schema if pyarrow.types.is_floating(field.type)]
    part = path.with_suffix(".part")
    pyarrow.parquet.write_table(
        table, part, compression="zstd", use_dictionary=["segment", "stretch", "filter"], use_byte_stream_split=numbers
    )
    part.replace(path)


def _whole(path: Path, text: str) -> None:
    """A file that is there whole or not at all."""
    part = path.with_suffix(".part")
    part.write_text(text, encoding="utf-8")
    part.replace(path)
