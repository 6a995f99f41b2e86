"""Pictures by matplotlib."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from ._needed import needed

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from ._result import Numbers, Segment


CYCLES = 4
"""How many of the last cycles are drawn if no window is given, as in the report."""
SAMPLES = 2000
"""How many of the last samples are drawn if the frequency of the motion is not known."""
POINTS = 4000
"""The most samples that are drawn one by one. More are drawn by the extremes of each pixel column, which give the same picture."""

Window: TypeAlias = "tuple[float | None, float | None] | None"


def plot(segments: Sequence[Segment], state: str | None, window: Window, ax: Axes | None, band: float) -> Axes:
    """A state of all filters over time, each with the standard deviations that it claims, and of the reference."""
    plt = needed("matplotlib.pyplot", "plot")

    if window is not None and not (isinstance(window, Sequence) and len(window) == 2):
        raise ValueError("`window` is a pair of times in s, such as (0.01, 0.02), with `None` for an end that is open")
    name = _known(segments, state)
    drawn = [(segment, _span(segment, window)) for segment in (segments if window is not None else segments[-1:])]
    drawn = [(segment, span) for segment, span in drawn if span.stop > span.start]
    if not drawn:
        raise ValueError(f"no sample lies in the window of {window} s; the segments cover {_covered(segments)}")
    ax = ax if ax is not None else _axes(plt)
    pixels = max(int(ax.get_window_extent().width), 1)
    labelled: set[str] = set()

    def label(text: str) -> str | None:
        """One entry of the legend for all segments."""
        new = text not in labelled
        labelled.add(text)
        return text if new else None

    unit = ""
    for segment, span in drawn:
        for number, trajectory in enumerate(segment):
            own = trajectory.states.get(name)
            if own is None:
                continue
            unit = own.unit
            time, mean = trajectory.time[span], own.mean[span]
            ax.plot(*_line(time, mean, pixels), color=f"C{number}", linewidth=1, label=label(trajectory.name))
            if own.sd is not None and band > 0:
                edges = _band(time, mean, own.sd[span], band, pixels)
                ax.fill_between(*edges, color=f"C{number}", alpha=0.25, linewidth=0)
        _reference(ax, segment, span, name, pixels, label)
        _settling(ax, segment, span, label)
    ax.set_xlabel("time (s)")
    ax.set_ylabel(f"{name} ({unit.replace('_per_', '/')})")
    ax.legend(loc="upper right", fontsize="small")
    return ax


def _axes(plt: Any) -> Axes:
    """Axes in a figure of their own."""
    axes: Axes = plt.subplots(figsize=(8, 3.2), layout="constrained")[1]
    return axes


def _known(segments: Sequence[Segment], state: str | None) -> str:
    """The name of a state that is there, the first if none is given."""
    known = list(dict.fromkeys(one for segment in segments for trajectory in segment for one in trajectory.states))
    if state is None and known:
        return known[0]
    if state is None or state not in known:
        raise KeyError(f"no state is called {state!r}; there are {', '.join(known) or 'none'}")
    return state


def _span(segment: Segment, window: Window) -> slice:
    """The samples of a segment in the window in s; without one, those of the last cycles of the motion."""
    time = segment.trajectories[0].time
    if window is not None:
        first, last = window
        begin = 0 if first is None else int(np.searchsorted(time, first, "left"))
        return slice(begin, len(time) if last is None else int(np.searchsorted(time, last, "right")))
    motion_hz = segment.metrics.get("motion_hz")
    if not motion_hz or len(time) == 0:
        return slice(max(len(time) - SAMPLES, 0), len(time))
    return slice(int(np.searchsorted(time, time[-1] - CYCLES / motion_hz, "left")), len(time))


def _covered(segments: Sequence[Segment]) -> str:
    times = [segment.trajectories[0].time for segment in segments]
    return ", ".join(f"{time[0]:.6g} s to {time[-1]:.6g} s" for time in times if len(time))


def _reference(ax: Axes, segment: Segment, span: slice, state: str, pixels: int, label: Callable[[str], str | None]) -> None:
    if state not in segment.references:
        return
    of, own = segment.references[state], segment.trajectories[0].time[span]
    shared = slice(int(np.searchsorted(of.time, own[0], "left")), int(np.searchsorted(of.time, own[-1], "right")))
    if shared.stop > shared.start:
        line = _line(of.time[shared], of.values[shared], pixels)
        ax.plot(*line, color="0.13", linewidth=1, linestyle="--", label=label("reference"))


def _settling(ax: Axes, segment: Segment, span: slice, label: Callable[[str], str | None]) -> None:
    time = segment.trajectories[0].time
    end = time[0] + segment.skip
    if np.isfinite(segment.skip) and end > time[span.start]:
        ax.axvspan(float(time[span.start]), float(min(end, time[span.stop - 1])), color="0.9", zorder=0, label=label("settling time"))


def _columns(time: Numbers, pixels: int) -> NDArray[np.intp]:
    """The first sample of each pixel column that has samples."""
    edges = np.linspace(time[0], time[-1], pixels + 1)[:-1]
    return np.unique(np.searchsorted(time, edges, "left"))


def _line(time: Numbers, values: Numbers, pixels: int) -> tuple[Numbers, Numbers]:
    """Fewer points for the same picture: the first, lowest, highest and last sample of each pixel column."""
    if len(time) <= POINTS:
        return time, values
    first = _columns(time, pixels)
    last = np.append(first[1:], len(time)) - 1
    low, high = np.fmin.reduceat(values, first), np.fmax.reduceat(values, first)
    middle = 0.5 * (time[first] + time[last])
    times = np.stack([time[first], middle, middle, time[last]], axis=1)
    return times.ravel(), np.stack([values[first], low, high, values[last]], axis=1).ravel()


def _band(time: Numbers, mean: Numbers, sd: Numbers, band: float, pixels: int) -> tuple[Numbers, Numbers, Numbers]:
    """The mean less and plus `band` standard deviations; of many samples the lowest and highest value of each pixel column, from its first sample to its last."""
    if len(time) <= POINTS:
        return time, mean - band * sd, mean + band * sd
    first = _columns(time, pixels)
    end = np.append(first[1:], len(time))
    low, high = np.empty(len(first)), np.empty(len(first))
    # Column by column, since arrays of all samples would take longer to get than to compute.
    for column, span in enumerate(map(slice, first, end)):
        half = band * sd[span]
        low[column], high[column] = np.fmin.reduce(mean[span] - half), np.fmax.reduce(mean[span] + half)
    times = np.stack([time[first], time[end - 1]], axis=1).ravel()
    return times, np.repeat(low, 2), np.repeat(high, 2)


def columns(*tables: Mapping[str, Numbers]) -> NDArray[np.object_]:
    """The columns of tables over their time, a panel for each."""
    plt = needed("matplotlib.pyplot", "plot")

    drawn = [(table["time_s"], name, values) for table in tables for name, values in table.items() if name != "time_s"]
    _, grid = plt.subplots(len(drawn), 1, figsize=(8, 0.6 + 1.5 * len(drawn)), sharex=True, layout="constrained", squeeze=False)
    axes: NDArray[np.object_] = grid[:, 0]
    for ax, (time, name, values) in zip(axes, drawn, strict=True):
        ax.plot(time, values, linewidth=0.8)
        quantity, _, unit = name.partition("_")
        ax.set_ylabel(f"{quantity} ({unit.replace('_per_', '/')})" if unit else name)
        ax.grid(color="0.9", linewidth=0.7)
    axes[-1].set_xlabel("time (s)")
    return axes


def chosen(figures: Sequence[dict[str, Any]], name: str) -> dict[str, Any]:
    """The figure of a report that has this name."""
    for figure in figures:
        if figure["id"] == name:
            return figure
    known = ", ".join(repr(figure["id"]) for figure in figures) or "none"
    raise KeyError(f"the report has no figure {name!r}; it has {known}")


def draw(figure: dict[str, Any]) -> NDArray[np.object_]:
    """A figure of a report: its axes, from top to bottom. Series have the colours and widths of the report."""
    plt = needed("matplotlib.pyplot", "plot")

    panels = figure["panels"]
    picture, grid = plt.subplots(
        len(panels), 1, figsize=(8, 0.8 + 1.9 * len(panels)), layout="constrained", squeeze=False
    )
    axes: NDArray[np.object_] = grid[:, 0]
    for number, (ax, panel) in enumerate(zip(axes, panels, strict=True)):
        if panel["shares_x"] and number > 0:
            ax.sharex(axes[number - 1])
        for series in panel["series"]:
            _series(ax, series)
        is_above_its_like = number + 1 < len(panels) and panels[number + 1]["shares_x"]
        ax.tick_params(labelbottom=not is_above_its_like)
        _axis(ax.xaxis, panel["x"], "" if is_above_its_like else _label(panel["x"]))
        _axis(ax.yaxis, panel["y"], _label(panel["y"]))
        if panel["x"]["range"]:
            ax.set_xlim(*panel["x"]["range"])
        if panel["y"]["range"]:
            ax.set_ylim(*panel["y"]["range"])
        ax.grid(color="0.9", linewidth=0.7)
        ax.set_axisbelow(True)
        if ax.get_legend_handles_labels()[0]:
            ax.legend(loc="upper right", fontsize="small")
    picture.suptitle(figure["title"], fontsize="medium")
    return axes


def _series(ax: Any, series: dict[str, Any]) -> None:
    kind, data, colour = series["kind"], series["data"], series["colour"]
    order = 2 + 0.1 * series["layer"]
    style: dict[str, Any] = {"color": colour, "zorder": order}
    line = {**style, "linewidth": 0.75 * series["width"], "linestyle": "--" if series["is_dashed"] else "-"}
    label: str | None = series["label"] or None
    if kind == "level":
        ax.axhline(data, label=label, **line)
    elif kind == "points":
        ax.plot(*np.array(data).reshape(-1, 2).T, ".", markersize=3, label=label, **style)
    elif kind == "map":
        _map(ax, data, label)
    else:
        for run in data:
            if kind == "line":
                ax.plot(*np.array(run).reshape(-1, 2).T, label=label, **line)
            else:
                ax.fill_between(*np.array(run).reshape(-1, 3).T, label=label, alpha=0.22, linewidth=0, **style)
            # One entry of the legend for all runs.
            label = None


def _map(ax: Any, data: dict[str, Any], label: str | None) -> None:
    values = np.array(data["values"], dtype=float)
    reach = float(np.nanmax(np.abs(values - data["level"])))
    mesh = ax.pcolormesh(
        data["x"], data["y"], values, cmap="RdBu_r", vmin=data["level"] - reach, vmax=data["level"] + reach, shading="nearest"
    )
    ax.figure.colorbar(mesh, ax=ax, label=_label(data["colours"]))
    ax.contour(data["x"], data["y"], values, levels=[data["level"]], colors="0.13", linewidths=1.2)
    if label:
        ax.plot([], [], color="0.13", linewidth=1.2, label=label)


def _label(axis: dict[str, Any]) -> str:
    unit = axis["unit"]
    return str(axis["label"]) if unit in ("", "1") or _takes_prefix(axis) else f"{axis['label']} ({unit})"


def _takes_prefix(axis: dict[str, Any]) -> bool:
    """Whether the labels of the ticks have the unit with an SI prefix, such as `20 ms`."""
    first = axis["unit"].split("/")[0]
    return not axis["is_logarithmic"] and first in ("s", "m", "g", "A", "K", "V", "F", "C", "N", "Pa", "Hz", "rad", "Ω")


def _axis(side: Any, axis: dict[str, Any], label: str) -> None:
    side.set_label_text(label)
    if axis["is_logarithmic"]:
        (side.axes.set_xscale if side.axis_name == "x" else side.axes.set_yscale)("log")
    elif _takes_prefix(axis):
        side.set_major_formatter(needed("matplotlib.ticker", "plot").EngFormatter(unit=axis["unit"]))
