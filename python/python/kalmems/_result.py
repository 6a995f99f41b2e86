"""What came of an experiment."""

from __future__ import annotations

import html
import json
import os
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, overload

import numpy as np
from numpy.typing import NDArray

from . import _arrow, _html, _kalmems
from ._errors import KalmemsError
from ._needed import needed
from ._recording import Recording

from .metrics import EstimatorMetrics, Metrics, SegmentMetrics

if TYPE_CHECKING:
    import pandas
    import polars
    import pyarrow
    import xarray
    from matplotlib.axes import Axes

    from ._experiment import Experiment, Progress
    from ._plot import Window

Numbers = NDArray[np.float64]


@dataclass(frozen=True)
class Notice:
    """What a reader must know before trusting a figure."""

    severity: str
    """`ok`, `note`, `warning` or `failure`."""
    text: str

    def __str__(self) -> str:
        return self.text


@dataclass(frozen=True, eq=False)
class State:
    """One state over time."""

    name: str
    unit: str
    """Its SI unit as names of columns have it, such as `rad_per_s`."""
    mean: Numbers
    sd: Numbers | None
    """The standard deviation that the filter claims; `None` where it claims none."""


@dataclass(frozen=True, eq=False)
class Reference:
    """The independent measurement of a state."""

    time: Numbers
    """The times of its samples in s, its delay taken off."""
    values: Numbers
    """The values in the unit of the state; not a number if missing."""


@dataclass(frozen=True, eq=False)
class SignalInnovations:
    """The innovations of a signal after the first one, each predicted by the past and the signals before it."""

    unit: str
    """Its SI unit as names of columns have it."""
    innovation: Numbers
    """Measured minus predicted; not a number where there was no update."""
    innovation_sd: Numbers
    nis: Numbers
    """The normalised innovation squared."""
    rejected: Numbers | NDArray[np.intp]
    """The samples that the filter's gate rejected."""


@dataclass(eq=False, repr=False)
class Trajectory:
    """A filter's answer over one segment, an element for each sample, in SI.

    Each state is an attribute, and its standard deviation with `_sd` behind: `trajectory.angle`, `trajectory.angle_sd`. All arrays are
    read-only views of what was computed.
    """

    key: str
    """The filter as a key of files and tables, such as `ekf`."""
    name: str
    """The filter as the experiment names it."""
    kind: str
    """`filtered`, `smoothed`, `model` (the model alone) or `lock_in` (the signal alone)."""
    time: Numbers
    """When, in s."""
    states: dict[str, State]
    measured: Numbers
    """The signal that the innovations are of."""
    innovation: Numbers
    """Measured minus predicted; not a number where there was no update."""
    innovation_sd: Numbers
    nis: Numbers
    """The normalised innovation squared, 1 on average of a filter that is right."""
    log_likelihood: Numbers
    signal_unit: str
    rejected: Numbers | NDArray[np.intp]
    """The samples that the filter's gate rejected."""
    further: dict[str, SignalInnovations]
    """The innovations of further signals, by their names, of a filter that several signals correct."""
    metrics: EstimatorMetrics = field(repr=False)
    """Its figures, as `metrics.json` has them."""
    seconds_per_step: float = field(default=0.0, repr=False)

    @property
    def verdict(self) -> str:
        """What its mean NIS, its lock and its sign say, such as `consistent`."""
        return str(self.metrics["verdict"])

    @property
    def grade(self) -> str | None:
        """How far its answer can be trusted, by all that is known, such as `passes`; `None` of what makes no claim."""
        grade = self.metrics["grade"]
        return None if grade is None else str(grade)

    def __getattr__(self, name: str) -> Numbers:
        states: dict[str, State] = self.__dict__.get("states", {})
        if name in states:
            return states[name].mean
        of = states.get(name.removesuffix("_sd"))
        if of is not None and of.sd is not None:
            return of.sd
        without = f": {self.__dict__.get('name')!r} claims no standard deviation" if name.removesuffix("_sd") in states else ""
        raise AttributeError(f"a trajectory of {', '.join(states)} has no `{name}`{without}")

    def __dir__(self) -> list[str]:
        own = list(super().__dir__())
        return own + list(self.states) + [f"{name}_sd" for name, state in self.states.items() if state.sd is not None]

    def __len__(self) -> int:
        return len(self.time)

    def columns(self) -> dict[str, Numbers]:
        """The columns of its file, by their names: `time_s`, `angle_rad`, `angle_sd_rad` and so on."""
        columns = {"time_s": self.time}
        for state in self.states.values():
            columns[f"{state.name}_{state.unit}"] = state.mean
            if state.sd is not None:
                columns[f"{state.name}_sd_{state.unit}"] = state.sd
        columns[f"innovation_{self.signal_unit}"] = self.innovation
        columns[f"innovation_sd_{self.signal_unit}"] = self.innovation_sd
        columns["nis_1"] = self.nis
        for name, one in self.further.items():
            columns[f"innovation_{name}_{one.unit}"] = one.innovation
            columns[f"innovation_sd_{name}_{one.unit}"] = one.innovation_sd
            columns[f"nis_{name}_1"] = one.nis
        return columns

    def to_pandas(self) -> pandas.DataFrame:
        """A `pandas.DataFrame`."""
        table: pandas.DataFrame = needed("pandas", "pandas").DataFrame(self.columns())
        return table

    def to_polars(self) -> polars.DataFrame:
        """A `polars.DataFrame`."""
        table: polars.DataFrame = needed("polars", "polars").DataFrame(self.columns())
        return table

    def to_arrow(self) -> pyarrow.Table:
        """A `pyarrow.Table`."""
        library = needed("pyarrow", "arrow")
        table: pyarrow.Table = library.table({name: library.array(values) for name, values in self.columns().items()})
        return table

    def to_xarray(self) -> xarray.Dataset:
        """An `xarray.Dataset` over `time`, in s, with the unit of each variable."""
        variables: dict[str, Any] = {}
        for state in self.states.values():
            variables[state.name] = ("time", state.mean, {"units": state.unit})
            if state.sd is not None:
                variables[f"{state.name}_sd"] = ("time", state.sd, {"units": state.unit})
        for name in ("innovation", "innovation_sd"):
            variables[name] = ("time", getattr(self, name), {"units": self.signal_unit})
        variables["nis"] = ("time", self.nis, {"units": "1"})
        for signal, one in self.further.items():
            variables[f"innovation_{signal}"] = ("time", one.innovation, {"units": one.unit})
            variables[f"innovation_sd_{signal}"] = ("time", one.innovation_sd, {"units": one.unit})
            variables[f"nis_{signal}"] = ("time", one.nis, {"units": "1"})
        coordinates = {"time": ("time", self.time, {"units": "s"})}
        table: xarray.Dataset = needed("xarray", "xarray").Dataset(variables, coords=coordinates, attrs={"filter": self.name})
        return table

    def to_parquet(self, path: str | os.PathLike[str]) -> None:
        """Writes a Parquet file (needs pyarrow), packed as floating-point numbers pack best."""
        needed("pyarrow.parquet", "arrow").write_table(
            self.to_arrow(), path, compression="zstd", use_dictionary=False, use_byte_stream_split=True
        )

    def to_mat(self, path: str | os.PathLike[str]) -> None:
        """Writes a MAT file (needs SciPy)."""
        needed("scipy.io", "mat").savemat(path, dict(self.columns()))

    def __repr__(self) -> str:
        return f"<Trajectory {self.name!r}, {self.kind}: {len(self)} samples of {', '.join(self.states)}>"

    def _repr_html_(self) -> str:
        span = f" from {self.time[0]:.6g} s to {self.time[-1]:.6g} s" if len(self) else ""
        judged = f", {self.grade}" if self.grade is not None else ""
        rows = [[state.name, state.unit, _last(state.mean), _last(state.sd)] for state in self.states.values()]
        heads = ["state", "unit", "last value", "its standard deviation"]
        return _html.heading(self.name) + _html.paragraph(f"{self.kind}: {len(self)} samples{span}{judged}") + _html.table(heads, rows)

    def __arrow_c_stream__(self, requested_schema: Any = None) -> Any:
        return _arrow.stream(self.columns())

    def __getstate__(self) -> dict[str, Any]:
        return self.__dict__

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)


def _last(values: Numbers | None) -> str:
    """The last of some values as text; nothing if there is none."""
    return "" if values is None or len(values) == 0 else f"{values[-1]:.6g}"


@dataclass(eq=False)
class Segment:
    """A record, or a stretch of one, with what each filter says of it."""

    recording: str
    label: str
    """Its label; empty where the recording is one record."""
    stretch: int
    """Which stretch of its record it is, from 1."""
    signal: str
    """The column of the signal."""
    skip: float
    """The settling time in s, which is not scored."""
    metrics: SegmentMetrics = field(repr=False)
    """Its figures, as `metrics.json` has them."""
    trajectories: list[Trajectory] = field(repr=False)
    references: dict[str, Reference] = field(default_factory=dict, repr=False)
    """What the reference knows of each state, for those that it has and that the module hands over."""

    def __getitem__(self, name: str) -> Trajectory:
        """A filter's answer, by its name or its key."""
        for trajectory in self.trajectories:
            if name in (trajectory.name, trajectory.key):
                return trajectory
        known = ", ".join(repr(trajectory.name) for trajectory in self.trajectories)
        raise KeyError(f"no filter is called {name!r}; there are {known}")

    def __contains__(self, filter: object) -> bool:
        """Whether there is an answer of a filter with this name or key."""
        return any(filter is one or filter in (one.name, one.key) for one in self.trajectories)

    def __iter__(self) -> Iterator[Trajectory]:
        return iter(self.trajectories)

    def _repr_html_(self) -> str:
        name = " ".join(one for one in (self.recording, self.label, f"stretch {self.stretch}" if self.stretch > 1 else "") if one)
        rows = [[one.name, one.kind, one.verdict, one.grade or "–"] for one in self.trajectories]
        return _html.heading(name) + _html.table(["filter", "kind", "verdict", "grade"], rows)

    @property
    def arbitrary_signs(self) -> list[str]:
        """The states whose sign the signals do not tell and nothing states: their trajectories may have the other one."""
        return list(self.metrics.get("arbitrary_signs", []))

    @property
    def arbitrary_half_turns(self) -> list[str]:
        """The states that come round which the signals do not tell from themselves half a period later."""
        return list(self.metrics.get("arbitrary_half_turns", []))

    @property
    def arbitrary_turns(self) -> list[list[str]]:
        """The states that turn together by any angle without another signal, one list for each turn."""
        return [list(turn) for turn in self.metrics.get("arbitrary_turns", [])]

    @property
    def best(self) -> Trajectory | None:
        """The answer whose predictions are the likeliest of those that can be trusted, where there is one."""
        likeliest = self.metrics.get("likeliest")
        if likeliest is not None:
            return self[likeliest["key"]]
        trusted = [one for one in self.trajectories if one.grade in ("passes", "passes_with_remarks")]
        return trusted[0] if len(trusted) == 1 else None


class Result:
    """An estimate: trajectories, figures, notices, and the report. It can be pickled."""

    def __init__(self, state: dict[str, Any]) -> None:
        self._outcome: _kalmems.Outcome | None = None
        self._report: str | None = None
        self._drawn: list[dict[str, Any]] | None = None
        self.metrics: Metrics = state["metrics"]
        """The figures, as `metrics.json` has them."""
        self.notices: list[Notice] = state["notices"]
        """What a reader must know before trusting a figure, the worst first."""
        self.segments: list[Segment] = state["segments"]
        self.sources: list[tuple[str, str, int]] = state["sources"]
        """What was read: file, SHA-256 and number of bytes of each."""
        self._tables: list[tuple[list[str], list[list[str]]]] = state["tables"]
        self.answers: list[str] = state["answers"]
        """The motion and how well it is known, a sentence for each quantity."""
        self._summary: str = state["summary"]
        self._toml: str = state["toml"]

    @classmethod
    def _of(cls, outcome: _kalmems.Outcome) -> Result:
        metrics: Metrics = json.loads(outcome.metrics_json())
        figures = [segment for recording in metrics["recordings"] for segment in recording["segments"]]
        segments = [_segment(own, told) for own, told in zip(outcome.segments(), figures, strict=True)]
        result = cls(
            {
                "metrics": metrics,
                "notices": [Notice(severity, text) for severity, text in outcome.notices()],
                "segments": segments,
                "sources": outcome.sources(),
                "tables": outcome.tables(),
                "answers": outcome.answers(),
                "summary": outcome.summary(),
                "toml": outcome.experiment_toml(),
            }
        )
        result._outcome = outcome
        return result

    @property
    def answer(self) -> str:
        """The sentence that `kalmems estimate` prints first: the motion, its claimed standard deviation, the filter and its grade; empty without one."""
        return self.answers[0] if self.answers else ""

    @property
    def trajectories(self) -> list[Trajectory]:
        """All answers, segment by segment."""
        return [trajectory for segment in self.segments for trajectory in segment.trajectories]

    def __getitem__(self, name: str) -> Trajectory:
        """A filter's answer, by its name or its key, where there is one segment."""
        if len(self.segments) != 1:
            raise KeyError(f"there are {len(self.segments)} segments; take one: `result.segments[0][{name!r}]`")
        return self.segments[0][name]

    def __contains__(self, filter: object) -> bool:
        """Whether some segment has an answer of a filter with this name or key."""
        return any(filter in segment for segment in self.segments)

    def __iter__(self) -> Iterator[Trajectory]:
        return iter(self.trajectories)

    def __len__(self) -> int:
        return len(self.trajectories)

    @property
    def best(self) -> Trajectory | None:
        """The answer to trust, where there is one segment and one such answer; see `Segment.best`."""
        return self.segments[0].best if len(self.segments) == 1 else None

    def experiment_toml(self) -> str:
        """The experiment as it was understood, every default written out."""
        return self._toml

    def summary(self) -> str:
        """The answers and tables that `kalmems estimate` prints."""
        return self._summary

    def _native(self) -> _kalmems.Outcome:
        if self._outcome is None:
            raise KalmemsError(
                "this result came from another process, and has numbers, notices and tables alone; write it or make its report "
                "where it was estimated"
            )
        return self._outcome

    def report_html(self) -> str:
        """The report as a page of HTML, pictures included. It is kept where the result is pickled afterwards."""
        if self._report is None:
            self._report = self._native().report_html()
        return self._report

    def show(self, *, height: int = 720) -> None:
        """Shows the report in the running notebook, as interactive as its page is, in a frame of this height in pixels."""
        _html.show(_html.Page(self.report_html(), height))

    def figures(self) -> dict[str, bytes]:
        """The pictures of the report by their names, as SVG."""
        return self._native().figures()

    def write(self, folder: str | os.PathLike[str], *, trajectories: bool = True, force: bool = False) -> Path:
        """Writes all of it into a folder, as `kalmems estimate` does, and whole or not at all. With `force` what another experiment left
        there is put aside."""
        return Path(self._native().write(Path(folder), trajectories, force))

    def _figures(self) -> list[dict[str, Any]]:
        """The figures of the report as data."""
        drawn = self._drawn
        if drawn is None:
            drawn = self._drawn = list(json.loads(self._native().figure_data()))
        return drawn

    @property
    def figure_names(self) -> list[str]:
        """The figures of the report, for `plot(figure=…)`."""
        return [str(figure["id"]) for figure in self._figures()]

    @overload
    def plot(
        self, state: str | None = None, *, figure: None = None, window: Window = None, ax: Axes | None = None, band: float = 2.0
    ) -> Axes: ...

    @overload
    def plot(self, *, figure: str) -> NDArray[np.object_]: ...

    def plot(
        self,
        state: str | None = None,
        *,
        figure: str | None = None,
        window: Window = None,
        ax: Axes | None = None,
        band: float = 2.0,
    ) -> Axes | NDArray[np.object_]:
        """Draws a state of all filters over time, each with its claim of `band` standard deviations (needs matplotlib). Returns the axes.

        The last cycles of the motion in the last segment are drawn, or its last 2000 samples if the frequency of the motion is not known.
        `window=(0.01, 0.02)` draws all segments from 10 ms to 20 ms, and `None` for an end leaves it open: `window=(None, None)` draws all.
        More than 4000 samples are drawn by the extremes of each pixel column, for the width that the axes have now.

        `figure` draws a figure of the report instead, such as `"nis"`; see `figure_names`. Its axes are an array, from top to bottom.
        """
        from . import _plot

        if figure is None:
            return _plot.plot(self.segments, state, window, ax, band)
        if state is not None or ax is not None or window is not None:
            raise ValueError("a figure of the report has states and axes of its own; leave `state`, `window` and `ax` out")
        return _plot.draw(_plot.chosen(self._figures(), figure))

    def __repr__(self) -> str:
        return f"<Result of {self.metrics['experiment']!r}>\n{self._summary}"

    def _repr_html_(self) -> str:
        parts = [_html.heading(str(self.metrics["experiment"]))]
        colours = {"failure": "#b00020", "warning": "#9a5b00", "note": "#555555", "ok": "#1b6e3c"}
        parts.extend(f"<p><b>{html.escape(answer)}</b></p>" for answer in self.answers)
        for notice in self.notices:
            colour = colours.get(notice.severity, "#555555")
            parts.append(f'<p style="color:{colour};margin:2px 0">{_html.coded(notice.text)}</p>')
        parts.extend(_html.table(heads, rows) for heads, rows in self._tables)
        return "\n".join(parts)

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in self.__dict__.items() if name != "_outcome"}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._outcome = None


def _segment(own: dict[str, Any], told: SegmentMetrics) -> Segment:
    trajectories = []
    for one, metrics in zip(own["trajectories"], told["estimators"], strict=True):
        states = {name: State(name, unit, mean, sd) for name, unit, mean, sd in one.pop("states")}
        rejected = np.asarray(one.pop("rejected"), dtype=np.intp)
        unit = one.pop("signal_unit") or own["signal_unit"]
        further = {
            name: SignalInnovations(of, innovation, sd, nis, np.asarray(samples, dtype=np.intp))
            for name, of, innovation, sd, nis, samples in one.pop("further")
        }
        trajectories.append(
            Trajectory(states=states, rejected=rejected, signal_unit=unit, further=further, metrics=metrics, **one)
        )
    references = {state: Reference(time, values) for state, time, values in own["references"]}
    heads = (own["recording"], own["label"], own["stretch"], own["signal"], own["skip"])
    return Segment(*heads, metrics=told, trajectories=trajectories, references=references)


@dataclass(frozen=True)
class Parameter:
    """A parameter that was identified, in SI."""

    name: str
    """Its name, such as `k` of the parameter `parameters.k` of a device by its equations."""
    value: float
    standard_error: float | None
    """`None` where the recordings do not determine it."""
    interval: tuple[float | None, float | None]
    """Where the truth lies 95 times in 100."""
    unit: str
    recording: str
    key: str
    """Its name as `kalmems identify` prints it, such as `parameters.k`."""
    stated: float | None = None
    """What the experiment states; `None` of what it has no key for."""


def _parameter(name: str, interval: Iterable[float | None], **found: Any) -> Parameter:
    low, high = interval
    return Parameter(name=name.removeprefix("parameters."), key=name, interval=(low, high), **found)


class Identification:
    """What recordings tell of a device, and the experiment with it."""

    def __init__(self, told: dict[str, Any], text: str, experiment: Experiment) -> None:
        self.parameters = [_parameter(**parameter) for parameter in told["parameters"]]
        self.answer: list[str] = told["answer"]
        """What was found, a sentence for each of the first numbers."""
        self.undetermined: list[dict[str, str]] = told["undetermined"]
        """What they do not tell, and why."""
        self.warnings: list[str] = told["warnings"]
        self.notes: list[str] = told["notes"]
        self.experiment = experiment
        """The experiment with the values in their places."""
        self._text = text

    def __getitem__(self, name: str) -> Parameter:
        """A parameter, by its name or its key."""
        for parameter in self.parameters:
            if name in (parameter.name, parameter.key):
                return parameter
        known = ", ".join(repr(parameter.name) for parameter in self.parameters)
        raise KeyError(f"no parameter is called {name!r}; there are {known}")

    def __contains__(self, parameter: object) -> bool:
        """Whether a parameter with this name or key was identified."""
        return any(parameter in (one, one.name, one.key) for one in self.parameters)

    def __iter__(self) -> Iterator[Parameter]:
        return iter(self.parameters)

    def __len__(self) -> int:
        return len(self.parameters)

    def __repr__(self) -> str:
        return self._text

    def _repr_html_(self) -> str:
        return f"<pre>{html.escape(self._text)}</pre>"


class Diagnosis:
    """What of an experiment is wrong."""

    def __init__(self, told: dict[str, Any], text: str, experiment: Experiment | None, each: list[Experiment | None]) -> None:
        self.told = told
        """All that was found, as `kalmems diagnose --json` prints it."""
        self.experiment = experiment
        """The experiment with the cause corrected, where it could say that and no other cause explains the recording with another answer."""
        self._text, self._each = text, each

    def corrected(self, cause: int | str) -> Experiment:
        """The experiment with the cause corrected that is named, or that has this place in the list: 1 for the first."""
        names = [one["name"] for one in self.told["causes"]]
        place = names.index(cause) if cause in names else int(cause) - 1 if str(cause).isdigit() else -1
        if not 0 <= place < len(names):
            raise KeyError(f"no cause is called {cause!r}; there are {', '.join(names)}")
        experiment = self._each[place]
        if experiment is None:
            raise ValueError(f"an experiment file cannot state {names[place]!r}, or nothing of it is to be written")
        return experiment

    def __repr__(self) -> str:
        return self._text

    def _repr_html_(self) -> str:
        return f"<pre>{html.escape(self._text)}</pre>"


class Simulation:
    """A recording that was computed."""

    def __init__(self, recorded: dict[str, Numbers], truth: dict[str, Numbers], experiment: Experiment) -> None:
        self.recorded = recorded
        """What a laboratory would have recorded, by the names of the columns."""
        self.truth = truth
        """The true motion, likewise. An estimate never reads it."""
        self.experiment = experiment
        """The experiment that estimates it."""

    def recording(self) -> Recording:
        """What was recorded, for an estimate."""
        return Recording(self.recorded)

    def reference(self) -> Recording:
        """The truth, for the comparison."""
        return Recording(self.truth)

    def estimate(self, *, progress: Progress = None, strict: bool = False) -> Result:
        """Estimates it, and compares with the truth; options as in `Experiment.estimate`."""
        return self.experiment.estimate(self.recording(), reference=self.reference(), progress=progress, strict=strict)

    def plot(self) -> NDArray[np.object_]:
        """Draws each column over time, with what is recorded above and the true motion below (needs matplotlib); the axes."""
        from ._plot import columns

        return columns(self.recorded, self.truth)

    def __repr__(self) -> str:
        columns = ", ".join((*self.recorded, *self.truth))
        return f"<Simulation: {len(next(iter(self.recorded.values())))} samples of {columns}>"

    def _repr_html_(self) -> str:
        return f"<p>{html.escape(repr(self)[1:-1])}</p>"
