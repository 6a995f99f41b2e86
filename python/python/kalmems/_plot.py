"""Pictures by matplotlib."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ._needed import needed

if TYPE_CHECKING:
    from ._result import Result


def plot(result: Result, state: str | None, ax: Any, band: float) -> Any:
    """A state of all filters over time, with what each claims."""
    plt = needed("matplotlib.pyplot", "plot")

    name = state if state is not None else next(iter(result.trajectories[0].states))
    known = list(dict.fromkeys(one for trajectory in result.trajectories for one in trajectory.states))
    if name not in known:
        raise KeyError(f"no state is called {name!r}; there are {', '.join(known)}")
    if ax is None:
        _, ax = plt.subplots(figsize=(8, 3.2), layout="constrained")
    unit = ""
    for segment in result.segments:
        for number, trajectory in enumerate(segment):
            own = trajectory.states.get(name)
            if own is None:
                continue
            unit = own.unit
            colour = f"C{number}"
            label = trajectory.name if segment is result.segments[0] else None
            ax.plot(trajectory.time, own.mean, color=colour, linewidth=1, label=label)
            if own.sd is not None and band > 0:
                low, high = own.mean - band * own.sd, own.mean + band * own.sd
                ax.fill_between(trajectory.time, low, high, color=colour, alpha=0.25, linewidth=0)
    first = result.segments[0].trajectories[0].time
    skip = result.segments[0].skip
    if len(result.segments) == 1 and np.isfinite(skip) and skip > 0:
        ax.axvspan(first[0], first[0] + skip, color="0.9", zorder=0, label="settling time")
    ax.set_xlabel("time (s)")
    ax.set_ylabel(f"{name} ({unit.replace('_per_', '/')})")
    ax.legend(loc="upper right", fontsize="small")
    return ax


def columns(*tables: dict[str, Any]) -> Any:
    """The columns of tables over their time, a panel for each."""
    plt = needed("matplotlib.pyplot", "plot")

    drawn = [(table["time_s"], name, values) for table in tables for name, values in table.items() if name != "time_s"]
    _, grid = plt.subplots(len(drawn), 1, figsize=(8, 0.6 + 1.5 * len(drawn)), sharex=True, layout="constrained", squeeze=False)
    axes = grid[:, 0]
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


def draw(figure: dict[str, Any]) -> Any:
    """A figure of a report: its axes, from top to bottom. Series have the colours and widths of the report."""
    plt = needed("matplotlib.pyplot", "plot")

    panels = figure["panels"]
    picture, grid = plt.subplots(
        len(panels), 1, figsize=(8, 0.8 + 1.9 * len(panels)), layout="constrained", squeeze=False
    )
    axes = grid[:, 0]
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
