"""Whether a filter's claims hold, on samples that are simulated."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

Numbers: TypeAlias = NDArray[np.float64]

INSIDE = 1.959963984540054
"""Standard deviations that hold an error 95 times in 100."""


@dataclass(frozen=True, eq=False, repr=False)
class Consistency:
    """What simulated runs say of a filter's claims. Intervals hold the mean over more runs 95 times in 100."""

    runs: int
    """How many were simulated."""
    nis: tuple[float, tuple[float, float]]
    """The mean normalised innovation squared of a number that is measured, and its interval: 1 for a filter that is right."""
    nees: tuple[float, tuple[float, float]]
    """The mean normalised estimation error squared of a state, and its interval: 1 for a filter that is right."""
    coverage: list[tuple[float, tuple[float, float]]]
    """Of each state how often the truth is within 1.96 claimed standard deviations, and its interval: 0.95 for a filter that is right."""

    @property
    def holds(self) -> bool:
        """Whether errors are not significantly larger than claimed, nor innovations than predicted."""
        return bool(self.nis[1][0] <= 1 and self.nees[1][0] <= 1 and all(high >= 0.95 for _, (_, high) in self.coverage))

    def __repr__(self) -> str:
        each = ", ".join(f"{share:.3f}" for share, _ in self.coverage)
        (nis, of_nis), (nees, of_nees) = self.nis, self.nees
        parts = f"NIS {nis:.3f} ({of_nis[0]:.3f} to {of_nis[1]:.3f}), NEES {nees:.3f} ({of_nees[0]:.3f} to {of_nees[1]:.3f})"
        return f"<Consistency of {self.runs} runs: {parts}, coverage {each}>"


def of_runs(found: list[tuple[float, float, Numbers]]) -> Consistency:
    """From NIS, NEES and coverage of each run."""
    nis, nees = (averaged(np.array([one[k] for one in found])) for k in (0, 1))
    shares = np.array([one[2] for one in found])
    return Consistency(len(found), nis, nees, [averaged(column) for column in shares.T])


def averaged(values: Numbers) -> tuple[float, tuple[float, float]]:
    """The mean of independent values and its interval."""
    mean, half = float(values.mean()), INSIDE * float(values.std(ddof=1)) / len(values) ** 0.5
    return mean, (mean - half, mean + half)


def scored(filtered: Any, states: Numbers) -> tuple[float, float, Numbers]:
    """NIS, NEES and coverage of a run whose true states are known."""
    count = (~np.isnan(filtered.innovation)).sum(axis=1)
    there = count > 0
    error = filtered.x - states
    # States without a variance are known, and have no part in it.
    nees = np.einsum("ki,kij,kj->k", error, np.linalg.pinv(filtered.P, rcond=1e-12, hermitian=True), error)
    ranks = np.linalg.matrix_rank(filtered.P, tol=None, hermitian=True)
    inside = np.abs(error) <= INSIDE * filtered.sd
    return float(filtered.nis[there].sum() / count[there].sum()), float(nees.sum() / max(ranks.sum(), 1)), inside.mean(axis=0)


def drawn(random: np.random.Generator, covariance: Numbers) -> Numbers:
    """A vector of this covariance, which may be singular."""
    values, vectors = np.linalg.eigh(covariance)
    return np.asarray(vectors @ (np.sqrt(np.maximum(values, 0)) * random.standard_normal(len(values))))


def simulated(
    random: np.random.Generator, parts: Mapping[str, Any], count: int, move: Callable[[Numbers, int], Numbers], see: Callable[[Numbers, int], Numbers]
) -> tuple[Numbers, Numbers]:
    """True states and samples of a model: x0, P0, Q and R, and how a state moves and is seen."""
    state = parts["x0"] + drawn(random, parts["P0"])
    states, samples = [], []
    for k in range(count):
        states.append(state)
        seen = see(state, k)
        samples.append(seen + drawn(random, of_sample(parts["R"], k)))
        state = move(state, k) + drawn(random, of_sample(parts["Q"], k))
    return np.array(states), np.array(samples)


def of_sample(matrix: Numbers, sample: int) -> Numbers:
    """That of a sample, of one for all or of one for each."""
    return np.asarray(matrix[sample] if matrix.ndim == 3 else matrix)
