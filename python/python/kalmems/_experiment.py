"""Experiments: a device, its recordings, and what is wanted of them."""

from __future__ import annotations

import contextlib
import json
import os
import warnings
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeAlias

from . import _html, _kalmems
from ._batch import Batch, Many, estimate_many
from ._errors import ExperimentError, RecordingError, VerdictError, VerdictWarning
from ._recording import Recording, as_recording, explained
from ._result import Diagnosis, Identification, Result, Simulation
from ._stream import Source, Stream
from ._study import Study
from ._tables import is_path, is_table, local

Recordings: TypeAlias = "object"
"""A `Recording` or what makes one, such as a table, the path of a file, or a mapping of names or roles to several of these."""
Progress: TypeAlias = "Callable[[str, int, int], object] | None"


class Experiment:
    """A device and its recordings, as an experiment file describes them.

    Nothing changes it: `replace` makes another one. It can be pickled.
    """

    def __init__(self, text: str, path: str | os.PathLike[str] | None = None) -> None:
        """Reads the text of an experiment file; the files that it names are sought in the folder of `path`."""
        if isinstance(text, os.PathLike) or (isinstance(text, str) and "\n" not in text and text.endswith(".toml")):
            raise ExperimentError(f"the text of an experiment is expected and a path was given; read it: `Experiment.load({str(text)!r})`")
        self._take(text, Path(path) if path is not None else Path("experiment.toml"), True)

    def _take(self, text: str, path: Path, has_lines: bool) -> None:
        self._text, self._path, self._has_lines = text, path, has_lines
        self.name, self.description, self.device = _kalmems.check(text, path, has_lines)

    @classmethod
    def _of(cls, text: str, path: Path, has_lines: bool) -> Experiment:
        made = cls.__new__(cls)
        made._take(text, path, has_lines)
        return made

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Experiment:
        """Reads an experiment file."""
        path = Path(path)
        return cls(path.read_text(encoding="utf-8"), path)

    @classmethod
    def parse(cls, text: str, path: str | os.PathLike[str] | None = None) -> Experiment:
        """The same as the constructor."""
        return cls(text, path)

    @classmethod
    def from_dict(cls, document: Mapping[str, object], path: str | os.PathLike[str] | None = None) -> Experiment:
        """Makes one of a dictionary with the keys of an experiment file. What is `None` is left out, and errors name the key.

        A recording that is always given as arrays needs no `file`.
        """
        document = dict(_mapping("document", document, '{"name": "scan", "device": {…}}'))
        recordings = document.get("recording")
        if isinstance(recordings, (list, tuple)):
            document["recording"] = [_with_file(one, number) for number, one in enumerate(recordings)]
        place = Path(path) if path is not None else Path("experiment.toml")
        return cls._of(_kalmems.to_toml(document), place, False)

    @property
    def path(self) -> Path:
        """Where it stands, or would stand."""
        return self._path

    def to_toml(self) -> str:
        """Its text."""
        return self._text

    def to_dict(self) -> dict[str, Any]:
        """Its keys and values."""
        document: dict[str, Any] = _kalmems.to_dict(self._text, self._path)
        return document

    def replace(self, changes: Mapping[str, object]) -> Experiment:
        """The same with other values at some keys: `replace({"simulate.seed": 7, "recording[0].clock.rate": "1 MHz"})`.

        What becomes `None` is left out: `replace({"recording[0].reference": None})` estimates without a reference.
        """
        own = dict(_mapping("changes", changes, '{"estimate.skip": "8 ms"}'))
        return self._of(_kalmems.replaced(self._text, self._path, own), self._path, False)

    def estimate(
        self,
        recordings: Recordings = None,
        *,
        reference: Recordings = None,
        progress: Progress = None,
        strict: bool = False,
    ) -> Result:
        """Estimates the motion, and compares it with the reference where there is one.

        `recordings` are used instead of the files that the experiment names: a `Recording`, a table of which one can be made, or the path of
        a file; or a mapping of the names or roles of recordings to several of these. If none are given, the files of the experiment are
        read. `reference` is the same for references.

        `progress` hears `(what, done, total)` now and then. Where an answer cannot be trusted a `VerdictWarning` says so, or, where
        `strict`, a `VerdictError`.
        """
        given = _Given(self, recordings, reference)
        of = given.experiment
        with given.explained():
            outcome = _kalmems.estimate(of._text, of._path, of._has_lines, given.recordings, given.references, progress)
        result = Result._of(outcome)
        failing = ", ".join(outcome.not_trusted())
        if failing and strict:
            reasons = "; ".join(notice.text for notice in result.notices if notice.severity in ("warning", "failure"))
            raise VerdictError(f"not every answer can be trusted: {failing}. {reasons}", result)
        if failing:
            # One sentence, since a notebook shows the notices with the result.
            warnings.warn(f"not every answer can be trusted: {failing}; `result.notices` says why", VerdictWarning, stacklevel=2)
        return result

    def estimate_many(
        self,
        recordings: Many,
        folder: str | os.PathLike[str],
        *,
        of: str | None = None,
        reference: str | None = None,
        threads: int | None = None,
        progress: Progress = None,
        force: bool = False,
    ) -> Batch:
        """Estimates many recordings, as `kalmems batch` does: a Parquet file with the trajectories of each, and one table.

        Recordings are files or patterns, such as `"recordings/*.csv"`, or a mapping of names of one's own to files, recordings or tables. A path with a
        scheme, such as `s3://bucket/scan.csv`, is read through fsspec, and so is `folder` written.

        What is finished is kept in a journal beside the folder: after an interruption, or with further recordings, the same call computes only
        what is missing. Recordings with the same content are estimated once, and one that fails is listed and keeps no other from being
        estimated.

        `of` says which recording of the experiment they stand for, by its name or role, where it has several. `reference` is the path of each
        recording's reference, with `{name}` in the place of its name; without it, a reference in a file of its own is left out. With `force` what
        another batch left there is put aside. So many `threads` work at once, or as many as the machine has.
        """
        return estimate_many(self, recordings, folder, of, reference, threads, progress, force)

    def identify(
        self, recordings: Recordings = None, *, reference: Recordings = None, progress: Progress = None
    ) -> Identification:
        """Identifies parameters of the device; recordings as in `estimate`."""
        given = _Given(self, recordings, reference)
        of = given.experiment
        with given.explained():
            found, text, experiment = _kalmems.identify(
                of._text, of._path, of._has_lines, given.recordings, given.references, progress
            )
        return Identification(json.loads(found), text, Experiment._of(experiment, self._path, False))

    def diagnose(
        self, recordings: Recordings = None, *, filter: str | None = None, thorough: bool = False, progress: Progress = None
    ) -> Diagnosis:
        """Finds what of the experiment is wrong by the innovations of a filter, that of this name or the first that can tell it; recordings as
        in `estimate`. It ends after the work of about twenty estimates and says what it leaves out, which it tries where it is `thorough`."""
        given = _Given(self, recordings)
        of = given.experiment
        with given.explained():
            found, text, chosen, each = _kalmems.diagnose(
                of._text, of._path, of._has_lines, given.recordings, filter, thorough, progress
            )

        def corrected(text: str | None) -> Experiment | None:
            return None if text is None else Experiment._of(text, self._path, False)

        return Diagnosis(json.loads(found), text, corrected(chosen), [corrected(text) for text in each])

    def simulate(self, *, seed: int | None = None, progress: Progress = None) -> Simulation:
        """Computes the recording that the table `simulate` describes, with another seed of its noise where one is given."""
        told = self if seed is None else self.replace({"simulate.seed": seed})
        recorded, truth, experiment = _kalmems.simulate(told._text, told._path, told._has_lines, progress)
        return Simulation(recorded, truth, Experiment._of(experiment, self._path, False))

    def study(
        self,
        vary: Sequence[Mapping[str, object]],
        *,
        repeats: int = 1,
        seed: int = 0,
        truth: Mapping[str, object] | None = None,
        figures: Sequence[Mapping[str, object]] = (),
        name: str | None = None,
    ) -> Study:
        """A study of it: `vary` has a table for each key that varies, as `[[vary]]` of a study file, such as
        `{"key": "estimate.skip", "values": ["4 ms", "8 ms"]}`."""
        if isinstance(vary, (str, Mapping)):
            expected = '[{"key": "estimate.skip", "values": ["4 ms", "8 ms"]}]'
            raise ExperimentError(f"`vary` is a list with a table for each key that varies, such as {expected}", key="vary")
        document = {"name": name or self.name, "repeats": repeats, "seed": seed, "vary": list(vary)}
        if truth:
            document["truth"] = dict(truth)
        if figures:
            document["figure"] = list(figures)
        return Study(self, document)

    def stream(self, source: Source, *, state: str | os.PathLike[str] | None = None) -> Stream:
        """Estimates samples while they arrive, as the table `stream` says: an iterator, with `async for` as well, over estimates and events.

        `source` gives pieces of bytes, text or arrays, or is an array or a table itself; see `Stream`.

        Where `state` names a file, what is needed to go on is kept there.
        """
        return Stream(self, source, state)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Experiment) and self.to_dict() == other.to_dict()

    __hash__ = None  # type: ignore[assignment]

    def __repr__(self) -> str:
        return f"<Experiment {self.name!r}, device {self.device}>"

    def _repr_html_(self) -> str:
        document = self.to_dict()
        texts = [self.description, f"Device: `{self.device}`"]
        parts = [_html.heading(self.name), *(_html.paragraph(text) for text in texts if text)]
        recordings = document.get("recording", [])
        if recordings:
            rows = [[str(one.get(key, "")) for key in ("name", "role", "file")] + [_listed(one.get("channels", {}))] for one in recordings]
            parts.append(_html.table(["recording", "role", "file", "channels"], rows))
        filters = document.get("estimate", {}).get("filter", [])
        if filters:
            names = ", ".join(str(one.get("name", one.get("kind", ""))) for one in filters)
            parts.append(_html.paragraph(f"Filters: {names}"))
        return "\n".join(parts)

    def __reduce__(self) -> tuple[Any, ...]:
        return (Experiment._of, (self._text, self._path, self._has_lines))


def _mapping(name: str, given: Mapping[str, object], example: str) -> Mapping[str, object]:
    if not isinstance(given, Mapping):
        raise ExperimentError(f"`{name}` is of the type {type(given).__name__}; expected a mapping of keys to values, such as {example}")
    return given


def _with_file(recording: object, number: int) -> object:
    """A recording with the name of a file, which arrays are given instead of."""
    return {**recording, "file": f"recording {number}"} if isinstance(recording, Mapping) and "file" not in recording else recording


def _listed(channels: Mapping[str, Any]) -> str:
    """Channels with their columns, such as `signal: cap_V`."""
    return ", ".join(f"{name}: {of.get('column', '') if isinstance(of, Mapping) else of}" for name, of in channels.items())


class _Given:
    """What is given instead of the files of an experiment: arrays to hand over, and paths, which the experiment names then."""

    def __init__(self, experiment: Experiment, recordings: Recordings, reference: Recordings = None) -> None:
        changes: dict[str, object] = {}
        self._arrays: list[Recording] = []
        self.recordings = self._taken(experiment, recordings, "file", changes)
        self.references = self._taken(experiment, reference, "reference.file", changes)
        self.experiment = experiment.replace(changes) if changes else experiment

    def _taken(
        self, experiment: Experiment, given: Recordings, key: str, changes: dict[str, object]
    ) -> list[tuple[str | None, _kalmems.Columns]]:
        taken = []
        for name, one in _by_name(given):
            if is_path(one):
                changes[f"recording[{_place(experiment, name)}].{key}"] = local(one)
            else:
                recording = as_recording(one)
                self._arrays.append(recording)
                taken.append((name, recording._native))
        return taken

    def explained(self) -> contextlib.AbstractContextManager[None]:
        """Where errors about columns that are left out say why."""
        return explained(self._arrays)


def _by_name(given: Recordings) -> list[tuple[str | None, object]]:
    """Each recording with its name; a mapping of names to arrays is one recording, and any other mapping has a recording for each name."""
    if given is None:
        return []
    if isinstance(given, Mapping) and not hasattr(given, "data_vars"):
        whole = [name for name, one in given.items() if isinstance(one, Recording) or is_path(one) or is_table(one)]
        if whole and len(whole) < len(given):
            raise RecordingError(f"{', '.join(map(repr, whole))} are recordings and the rest are columns; give either recordings or columns")
        if whole:
            return list(given.items())
    return [(None, given)]


def _place(experiment: Experiment, name: str | None) -> int:
    """The place of the recording with this name or role; without one, of the only recording, or the only one of the role `test`."""
    recordings = experiment.to_dict().get("recording", [])
    if name is None and len(recordings) == 1:
        return 0
    wanted, keys = ("test", ["role"]) if name is None else (name, ["name", "role"])
    places = [place for place, one in enumerate(recordings) if wanted in map(one.get, keys)]
    if len(places) != 1:
        known = ", ".join(f"`{one.get('name') or one.get('role')}`" for one in recordings)
        message = f"which recording the path is for is not clear; give a mapping of a name or role to it, of {known}"
        raise ExperimentError(message, str(experiment.path), "recording")
    return places[0]
