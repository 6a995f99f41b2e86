"""What a filter does not know of its model, learned from samples."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._needed import needed

Numbers: TypeAlias = NDArray[np.float64]
HALF_95 = 0.5 * 3.841458820694124
"""How far the logarithm of the likelihood falls from its largest value to either end of an interval that holds 95 times in 100 (Wilks)."""
STEP = 1e-3
"""A step for differences, in scales of the numbers."""
MATRIX_STEP = 6e-6
"""A step for the differences of matrices, relative to a number."""
SECOND = 0.3
"""A step for second differences, in standard deviations."""
FARTHEST = 12.0
"""How many standard deviations away the end of an interval is looked for."""
FALLS = 1e-3
"""A gradient in standard deviations from which on a maximum is none."""


@dataclass(frozen=True, eq=False, repr=False)
class Likelihood:
    """ln p(z) as a function of an array of numbers."""

    _value: Callable[[Numbers], float]
    _scales: Numbers
    _slope: Callable[[Numbers], Numbers] | None = None

    def __call__(self, numbers: ArrayLike) -> float:
        """ln p(z); minus infinity with numbers by which the filter stops."""
        return self._value(np.asarray(numbers, dtype=np.float64))

    def gradient(self, numbers: ArrayLike) -> Numbers:
        """Its derivatives by these numbers: by the sensitivities of the filter, exact for matrices and for an `Ekf` with `F` and `H` in Python;
        otherwise by central differences."""
        return self._gradient(np.asarray(numbers, dtype=np.float64), STEP * self._scales)

    def _gradient(self, at: Numbers, steps: Numbers) -> Numbers:
        return gradient(self, at, steps) if self._slope is None else self._slope(at)


@dataclass(frozen=True, eq=False, repr=False)
class Fit:
    """Numbers of a model by maximum likelihood.

    A number that the samples do not determine has the standard deviation `inf`.
    """

    values: dict[str, float]
    """Where the likelihood is largest."""
    sd: dict[str, float]
    """Standard deviations, by the second derivatives there."""
    covariance: Numbers
    """The covariance of the numbers in their order; of those in `positive` that of their logarithms."""
    log_likelihood: float
    """ln p(z) there."""
    converged: bool
    """Whether the search ended where no direction leads on."""
    positive: frozenset[str]
    _likelihood: Likelihood = field()

    @property
    def aic(self) -> float:
        """Akaike's criterion, 2·(count of numbers) − 2·ln p(z): the smaller the better."""
        return 2 * len(self.values) - 2 * self.log_likelihood

    def interval(self, name: str) -> tuple[float, float]:
        """The values from which the likelihood, largest over all other numbers, tells this one 95 times in 100; `inf` where it falls nowhere."""
        names = list(self.values)
        if name not in names:
            raise KeyError(f"no number is called {name!r}; there are {', '.join(names)}")
        place = names.index(name)
        best = _searched(self.values, self.positive)
        sd = float(np.sqrt(self.covariance[place, place]))
        if not np.isfinite(sd):
            return (0.0 if name in self.positive else -np.inf), np.inf
        ends = [self._end(best, place, sign * sd) for sign in (-1, 1)]
        low, high = (float(np.exp(end)) for end in ends) if name in self.positive else ends
        return low, high

    def _end(self, best: Numbers, place: int, sd: float) -> float:
        optimize = needed("scipy.optimize", "fit")
        rest = np.delete(np.arange(best.size), place)
        along = self.covariance[rest, place] / self.covariance[place, place]
        scales = np.sqrt(np.diag(self.covariance))[rest]

        def above(times: float) -> float:
            moved = best.copy()
            moved[place] += times * sd
            moved[rest] += times * sd * along

            def less(steps: Numbers) -> float:
                at = moved.copy()
                at[rest] += steps * scales
                return -self._likelihood(at)

            if rest.size == 0:
                largest = self._likelihood(moved)
            else:
                largest = -float(optimize.minimize(less, np.zeros(rest.size), method="BFGS", options={"gtol": 1e-3}).fun)
            return largest - self.log_likelihood + HALF_95

        far = 2.0
        while above(far) > 0:
            far *= 1.5
            if far > FARTHEST:
                return float(np.copysign(np.inf, sd))
        return float(best[place] + sd * optimize.brentq(above, 0.0, far, xtol=1e-3))

    def __repr__(self) -> str:
        each = ", ".join(f"{name}={value:.6g} ± {self.sd[name]:.2g}" for name, value in self.values.items())
        end = "" if self.converged else ", not converged"
        return f"<Fit: {each}, log-likelihood {self.log_likelihood:.6g}{end}>"


def _searched(values: Mapping[str, float], positive: Collection[str]) -> Numbers:
    """The numbers as they are searched: the logarithms of those that are positive."""
    return np.array([np.log(value) if name in positive else value for name, value in values.items()])


def gradient(likelihood: Likelihood, at: Numbers, steps: Numbers) -> Numbers:
    """Central differences over these steps."""
    found = np.empty(at.size)
    for place, step in enumerate(steps):
        move = np.zeros(at.size)
        move[place] = step
        found[place] = (likelihood(at + move) - likelihood(at - move)) / (2 * step)
    return found


def steps_of(at: Numbers, scales: Numbers) -> Numbers:
    """Steps of each number for the differences of what a model is made of."""
    return np.asarray(MATRIX_STEP * np.maximum(np.abs(at), 10 * scales))


def around(at: Numbers, scales: Numbers) -> list[Numbers]:
    """The numbers with a step of the first one more and less, of the second one, and so on."""
    return [at + sign * step for step in np.diag(steps_of(at, scales)) for sign in (1, -1)]


def along(model: Callable[[Numbers], Mapping[str, Numbers]], by: Mapping[str, Numbers], at: Numbers, scales: Numbers) -> Numbers:
    """Derivatives by numbers of what depends on the matrices of a model, whose derivatives by these are known."""
    moved, steps = [model(one) for one in around(at, scales)], steps_of(at, scales)
    each = zip(moved[::2], moved[1::2], strict=True)
    return np.array([sum(float(np.sum(by[name] * (above[name] - below[name]))) for name in by) for above, below in each]) / (2 * steps)


def check_start(start: Mapping[str, float], positive: Collection[str]) -> None:
    """Refuses numbers with which no search can begin."""
    unknown = set(positive) - set(start)
    if unknown:
        raise ValueError(f"`positive` names {', '.join(sorted(unknown))}; `start` has {', '.join(start)}")
    for name, value in start.items():
        if not np.isfinite(value) or (name in positive and not value > 0):
            raise ValueError(f"`start` has {name} = {value}; expected a finite number{' above 0' if name in positive else ''}")


def scales_of(start: Mapping[str, float], positive: Collection[str]) -> Numbers:
    """A tenth of a number, or of a logarithm, as far as nothing is known of it."""
    return np.array([0.1 if name in positive or value == 0 else 0.1 * abs(value) for name, value in start.items()])


def maximised(likelihood: Likelihood, start: Mapping[str, float], positive: Collection[str]) -> Fit:
    """The numbers at which the likelihood is largest, from these on."""
    optimize = needed("scipy.optimize", "fit")
    first = _searched(start, positive)
    if not np.isfinite(likelihood(first)):
        raise ValueError("the likelihood of `start` is not finite; begin with larger variances")
    scales = scales_of(start, positive)
    at = first
    for _ in range(3):
        scaled = _minimum(optimize, likelihood, at, scales)
        at = at + scaled * scales
        curvature = _second(likelihood, at, scales)
        with np.errstate(divide="ignore", invalid="ignore"):
            own = 1 / np.sqrt(np.diag(curvature))
        sound = np.isfinite(own)
        # From now on the step of each is its own standard deviation, by the others as they are.
        scales = np.where(sound, np.clip(own, 1e-4 * scales, 1e2 * scales), scales)
    curvature = _second(likelihood, at, scales)
    slope = likelihood._gradient(at, 1e-2 * scales) * scales
    covariance, determined = _inverse(curvature, scales)
    sd = np.sqrt(np.diag(covariance))
    names = list(start)
    values = {name: float(np.exp(value)) if name in positive else float(value) for name, value in zip(names, at, strict=True)}
    each = {name: float(sd[i] * values[name]) if name in positive else float(sd[i]) for i, name in enumerate(names)}
    converged = bool(determined and np.abs(slope).max() < FALLS * max(1.0, np.sqrt(abs(likelihood(at)))))
    return Fit(values, each, covariance, float(likelihood(at)), converged, frozenset(positive), likelihood)


def _minimum(optimize: Any, likelihood: Likelihood, at: Numbers, scales: Numbers) -> Numbers:
    def less(steps: Numbers) -> float:
        value = likelihood(at + steps * scales)
        return -value if np.isfinite(value) else 1e300

    def slope(steps: Numbers) -> Numbers:
        return -likelihood._gradient(at + steps * scales, STEP * scales) * scales

    found = optimize.minimize(less, np.zeros(at.size), jac=slope, method="BFGS", options={"gtol": 1e-4})
    return np.asarray(found.x, dtype=np.float64)


def _second(likelihood: Likelihood, at: Numbers, scales: Numbers) -> Numbers:
    """Minus the second derivatives, by differences over a part of a standard deviation."""
    count, steps = at.size, SECOND * scales
    found, here = np.empty((count, count)), likelihood(at)

    def moved(i: int, j: int, signs: tuple[int, int]) -> float:
        to = at.copy()
        to[i] += signs[0] * steps[i]
        to[j] += signs[1] * steps[j]
        return likelihood(to)

    for i in range(count):
        move = np.zeros(count)
        move[i] = steps[i]
        found[i, i] = -(likelihood(at + move) - 2 * here + likelihood(at - move)) / steps[i] ** 2
        for j in range(i):
            crossed = moved(i, j, (1, 1)) - moved(i, j, (1, -1)) - moved(i, j, (-1, 1)) + moved(i, j, (-1, -1))
            found[i, j] = found[j, i] = -crossed / (4 * steps[i] * steps[j])
    return found


def _inverse(curvature: Numbers, scales: Numbers) -> tuple[Numbers, bool]:
    """The covariance, and whether all directions are determined; a number that has a part in one that is not has an infinite variance."""
    count = len(curvature)
    if not np.isfinite(curvature).all():
        return np.diag(np.full(count, np.inf)), False
    eigenvalues, vectors = np.linalg.eigh(curvature * np.outer(scales, scales))
    # The likelihood falls by less than 1e-4 over a standard deviation of the others.
    open_ones = eigenvalues < 1e-4
    inverse = (vectors / np.where(open_ones, 1.0, eigenvalues)) @ vectors.T
    covariance = inverse * np.outer(scales, scales)
    for vector in vectors.T[open_ones]:
        for place in np.flatnonzero(np.abs(vector) > 0.1):
            covariance[place, :] = covariance[:, place] = 0.0
            covariance[place, place] = np.inf
    return covariance, not open_ones.any()


@dataclass(frozen=True, eq=False, repr=False)
class Learned:
    """A linear model that expectation maximisation has led to.

    Matrices that were not to be learned are as they were given.
    """

    F: Numbers
    H: Numbers
    Q: Numbers
    R: Numbers
    x0: Numbers
    log_likelihood: Numbers
    """ln p(z) before each iteration and after the last, which never falls."""
    converged: bool
    """Whether it rose by less than the tolerance at the end."""

    def __repr__(self) -> str:
        end = "converged" if self.converged else "not converged"
        count = len(self.log_likelihood) - 1
        return f"<Learned: {count} iterations, {end}, log-likelihood {self.log_likelihood[-1]:.6g}>"


def moments(filtered: Any, motion: Numbers, noise: Numbers) -> tuple[Numbers, Numbers, Numbers]:
    """Smoothed means, covariances, and those of neighbours, E[(x⁺ − x̂⁺)(x − x̂)ᵀ]."""
    x, p = filtered.smoothed.x, filtered.smoothed.P
    before = filtered.P[:-1]
    predicted = motion @ before @ motion.T + noise
    # G = P·Fᵀ·(P⁺)⁻¹, where P⁺ may be singular.
    gain = before @ motion.T @ np.linalg.pinv(predicted, rcond=1e-13, hermitian=True)
    return x, p, p[1:] @ gain.transpose(0, 2, 1)


def step_covariance(x: Numbers, p: Numbers, crossed: Numbers, motion: Numbers, driven: Numbers | None) -> Numbers:
    """The mean of E[w·wᵀ] over the steps, w = x⁺ − F·x − B·u."""
    left = x[1:] - x[:-1] @ motion.T - (0.0 if driven is None else driven[:-1])
    of_means = left.T @ left
    along = motion @ crossed.sum(axis=0).T
    whole = of_means + p[1:].sum(axis=0) - along - along.T + motion @ p[:-1].sum(axis=0) @ motion.T
    return symmetric(whole / (len(x) - 1))


def sample_covariance(z: Numbers, x: Numbers, p: Numbers, sensor: Numbers, noise: Numbers) -> Numbers:
    """The mean of E[v·vᵀ] over the samples, v = z − H·x; of numbers that are missing by those that are there and the noise as it was."""
    left, total, rows = z - x @ sensor.T, np.zeros_like(noise), 0
    is_missing = np.isnan(z)
    for pattern in np.unique(is_missing, axis=0):
        if pattern.all():
            continue
        chosen = (is_missing == pattern).all(axis=1)
        there, gone = np.flatnonzero(~pattern), np.flatnonzero(pattern)
        own, count = left[chosen][:, there], int(chosen.sum())
        known = own.T @ own + sensor[there] @ p[chosen].sum(axis=0) @ sensor[there].T
        part = np.zeros_like(noise)
        part[np.ix_(there, there)] = known
        if gone.size:
            by = noise[np.ix_(gone, there)] @ np.linalg.inv(noise[np.ix_(there, there)])
            part[np.ix_(gone, there)] = by @ known
            part[np.ix_(there, gone)] = part[np.ix_(gone, there)].T
            rest = noise[np.ix_(gone, gone)] - by @ noise[np.ix_(there, gone)]
            part[np.ix_(gone, gone)] = by @ known @ by.T + count * rest
        total, rows = total + part, rows + count
    return symmetric(total / rows)


def symmetric(matrix: Numbers) -> Numbers:
    """Without what rounding makes different on either side of the diagonal."""
    return 0.5 * (matrix + matrix.T)
