"""The product's verdict on a filter that is known by its innovations alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _kalmems
from ._model_checks import numbers

Numbers: TypeAlias = NDArray[np.float64]

WRONG = 1e-6
"""The probability below which a finding contradicts the claim, as in the verdict of an experiment."""


@dataclass(frozen=True)
class Finding:
    """What a test of the innovations finds."""

    test: str
    """What is tested, such as `correlation`."""
    p_value: float
    """The probability of a finding as large with a consistent filter, corrected for the number of places and signals."""
    size: float
    """The size of the finding, in the unit of the test."""
    text: str
    """The finding as a sentence, with its usual cause."""

    @property
    def fails(self) -> bool:
        """Whether it contradicts what the filter claims: a probability below 10⁻⁶."""
        return self.p_value < WRONG


@dataclass(frozen=True, repr=False)
class FilterVerdict:
    """Whether the innovations contradict what a filter claims, by the tests of `Experiment.estimate`.

    The errors of the states are not known here: with a model that is wrong in what the measurements do not show, the grade can be `passes`.
    """

    grade: str
    """`passes`, `passes with remarks`, `doubtful` or `failed`."""
    mean_nis: float
    """The mean normalised innovation squared of a number that is measured: 1 on average for a consistent filter."""
    interval: tuple[float, float]
    """Where the mean NIS of a consistent filter lies 95 times in 100."""
    updates: int
    """Count of the numbers that corrected the state."""
    findings: list[Finding]
    """One for each test and signal that had enough innovations."""

    @property
    def failing(self) -> list[Finding]:
        """The findings that contradict the claim."""
        return [one for one in self.findings if one.fails]

    def __repr__(self) -> str:
        low, high = self.interval
        head = f"<FilterVerdict: {self.grade}, mean NIS {self.mean_nis:.3f} (expected {low:.3f} to {high:.3f}), {self.updates} updates"
        return head + "".join(f"\n  {one.text}" for one in self.failing) + ">"


def judged(
    innovations: tuple[Numbers, Numbers, Numbers, NDArray[np.bool_]], times: Numbers, names: Sequence[str] | None, motions_hz: ArrayLike, whitens: bool
) -> FilterVerdict:
    """The verdict of innovations, their covariances, their NIS and which were taken, at times in s."""
    innovation, s, nis, taken = innovations
    m = innovation.shape[1]
    called = [f"measurement {place}" for place in range(m)] if names is None else list(names)
    if len(called) != m:
        raise ValueError(f"`names` has {len(called)} names; there are {m} measurements")
    if times.shape != (len(innovation),) or not (np.diff(times) > 0).all():
        raise ValueError(f"`times` has the shape {times.shape}; expected increasing times in s, of the shape ({len(innovation)},)")
    used = np.where(taken[:, None], innovation, np.nan)
    sd = np.sqrt(np.diagonal(s, axis1=1, axis2=2))
    signals = [(name, times.tolist(), used[:, place].tolist(), sd[:, place].tolist()) for place, name in enumerate(called)]
    hz = np.atleast_1d(numbers("`motions_hz`", motions_hz)).tolist()
    count = int(np.isfinite(used).sum())
    grade, found, size = _kalmems.innovation_tests(signals, hz, whitens, float(np.nansum(nis[taken])), count)
    mean, low, high, updates = size
    return FilterVerdict(grade, mean, (low, high), updates, [Finding(*one) for one in found])


def times_of(rows: int, times: Any, interval: float | None) -> Numbers:
    """Times in s, from one of both."""
    if times is not None and interval is not None:
        raise ValueError("`times` and `interval` exclude each other; give one of them")
    if times is not None:
        return numbers("`times`", times)
    step = 1.0 if interval is None else float(interval)
    if not step > 0:
        raise ValueError(f"`interval` is {step}; expected seconds from a sample to the next, above 0")
    return np.asarray(step * np.arange(rows), dtype=np.float64)
