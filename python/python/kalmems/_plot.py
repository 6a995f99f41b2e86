"""Pictures by matplotlib."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from ._result import Result


def plot(result: Result, state: str | None, ax: Any, band: float) -> Any:
    """A state of all filters over time, with what each claims."""
    import matplotlib.pyplot as plt

    if ax is None:
        _, ax = plt.subplots(figsize=(8, 3.2), layout="constrained")
    name = state if state is not None else next(iter(result.trajectories[0].states))
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
