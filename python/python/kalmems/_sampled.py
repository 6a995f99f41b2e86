"""Filters that carry many states in place of a mean and a covariance, and several models in place of one."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from ._consistency import drawn, of_sample
from ._later import EnsembleLater, Later, OfModels, ParticlesLater, of_models
from ._later import weighted as moments
from ._model_checks import numbers

Numbers: TypeAlias = NDArray[np.float64]
OfMany: TypeAlias = Callable[[Numbers, Numbers | None], Numbers]
"""A function of states, one in each row, and of the inputs of a sample; a row of values for each."""

FEW = 0.5
"""The effective share of the particles below which they are drawn anew."""


def of_many(name: str, function: Callable[..., Any], count: int, at: Numbers, u: Numbers | None) -> OfMany:
    """A function of one state for many: called once with an axis more where it gives the same numbers then, otherwise one by one."""

    def one(x: Numbers, inputs: Numbers | None) -> Numbers:
        found = numbers(f"what `{name}` gives", function(x) if inputs is None else function(x, inputs))
        if found.size != count:
            raise ValueError(f"`{name}` gives an array of the shape {found.shape}; expected ({count},)")
        return found.reshape(count)

    def each(states: Numbers, inputs: Numbers | None) -> Numbers:
        return np.array([one(x, inputs) for x in states])

    def together(states: Numbers, inputs: Numbers | None) -> Numbers:
        found = function(states.T) if inputs is None else function(states.T, inputs)
        # The only value need not be an array of its own.
        found = found if count > 1 or np.ndim(found) > 1 else [found]
        columns = np.broadcast_arrays(*(np.asarray(row, dtype=np.float64) for row in found), np.empty(len(states)))
        return np.asarray(np.stack(columns[:-1], axis=1), dtype=np.float64)

    tried = at[:3]
    expected = each(tried, u)
    try:
        found = together(tried, u)
        # `matrix @ x` and whatever else goes along the first axis; not `x.sum()`.
        return together if found.shape == expected.shape and np.allclose(found, expected, rtol=1e-12, atol=0.0) else each
    except Exception:  # noqa: BLE001 - whatever a function does with an axis that it was not written for
        return each


def log_density(left: Numbers, covariance: Numbers) -> Numbers:
    """ln of the normal density of each row, of the mean 0."""
    with np.errstate(over="ignore"):
        squares = np.einsum("ij,ji->i", left, np.linalg.solve(covariance, left.T))
    return np.asarray(-0.5 * (squares + np.linalg.slogdet(2 * np.pi * covariance)[1]))


def chosen(random: np.random.Generator, weights: Numbers) -> NDArray[np.intp]:
    """Places drawn with these weights, systematically: one number for all of them."""
    places = (random.uniform() + np.arange(len(weights))) / len(weights)
    return np.minimum(np.searchsorted(np.cumsum(weights), places), len(weights) - 1)


class Rows:
    """What a filter says of each sample."""

    def __init__(self, rows: int, n: int, m: int) -> None:
        self.found: dict[str, Any] = {
            "x": np.empty((rows, n)),
            "P": np.empty((rows, n, n)),
            "innovation": np.full((rows, m), np.nan),
            "S": np.full((rows, m, m), np.nan),
            "nis": np.full(rows, np.nan),
            "log_likelihood": np.full(rows, np.nan),
            "taken": np.zeros(rows, dtype=bool),
        }

    def predicted(self, k: int, there: NDArray[np.intp], left: Numbers, s: Numbers, log_likelihood: float) -> None:
        """The innovation of the numbers that are there."""
        self.found["innovation"][k, there] = left
        self.found["S"][k][np.ix_(there, there)] = s
        self.found["nis"][k] = left @ np.linalg.solve(s, left)
        self.found["log_likelihood"][k] = log_likelihood
        self.found["taken"][k] = True

    def known(self, k: int, mean: Numbers, covariance: Numbers) -> None:
        """The state after a sample."""
        self.found["x"][k], self.found["P"][k] = mean, covariance


Parts: TypeAlias = tuple[Callable[..., Any], Callable[..., Any], Numbers, Numbers]
"""f, h, Q and R."""
Given: TypeAlias = tuple[Numbers, Numbers, Numbers, Numbers | None]
"""z, x0, P0 and u."""


def _begun(parts: Parts, given: Given, count: int, random: np.random.Generator) -> tuple[Numbers, OfMany, OfMany]:
    f, h, q, r = parts
    z, x0, p0, u = given
    states = x0 + np.array([drawn(random, p0) for _ in range(count)])
    first = None if u is None else u[0]
    return states, of_many("f", f, len(x0), states, first), of_many("h", h, z.shape[1], states, first)


def _logarithms(chances: Numbers) -> Numbers:
    with np.errstate(divide="ignore"):
        return np.log(chances)


def _noises(random: np.random.Generator, covariance: Numbers, count: int) -> Numbers:
    values, vectors = np.linalg.eigh(covariance)
    return np.asarray((random.standard_normal((count, len(values))) * np.sqrt(np.maximum(values, 0))) @ vectors.T)


def by_ensemble(parts: Parts, given: Given, count: int, seed: int, lag: int) -> dict[str, Any]:
    """Evensen's filter with perturbed samples."""
    random, (z, _, _, u) = np.random.default_rng(seed), given
    states, move, see = _begun(parts, given, count, random)
    equal, rows = np.full(count, 1 / count), Rows(len(z), states.shape[1], z.shape[1])
    later = EnsembleLater(lag, len(z), states.shape[1])
    for k, sample in enumerate(z):
        if k > 0:
            before = None if u is None else u[k - 1]
            states = move(states, before) + _noises(random, of_sample(parts[2], k - 1), count)
            later.predicted(states)
        there = np.flatnonzero(~np.isnan(sample))
        if there.size:
            seen = see(states, None if u is None else u[k])[:, there]
            noise = of_sample(parts[3], k)[np.ix_(there, there)]
            mean, spread = moments(seen, equal)
            unbiased = count / (count - 1)
            s = unbiased * spread + noise
            crossed = unbiased * (states - states.mean(axis=0)).T @ (seen - mean) / count
            left = sample[there] - mean
            rows.predicted(k, there, left, s, float(log_density(left[None], s)[0]))
            off = sample[there] + _noises(random, noise, count) - seen
            states = states + off @ np.linalg.solve(s, crossed.T)
            later.corrected(seen, np.linalg.solve(s, off.T).T)
        mean, covariance = moments(states, equal)
        rows.known(k, mean, covariance * count / (count - 1))
        later.known(k, states)
    return {**rows.found, **later.finish()}


def by_particles(parts: Parts, given: Given, count: int, auxiliary: bool, seed: int, lag: int) -> dict[str, Any]:
    """The bootstrap filter (Gordon, Salmond and Smith 1993), or the auxiliary one (Pitt and Shephard 1999)."""
    random, (z, _, _, u) = np.random.default_rng(seed), given
    states, move, see = _begun(parts, given, count, random)
    weights, rows = np.full(count, 1 / count), Rows(len(z), states.shape[1], z.shape[1])
    later = ParticlesLater(lag, len(z), states.shape[1])
    for k, sample in enumerate(z):
        there, inputs = np.flatnonzero(~np.isnan(sample)), None if u is None else u[k]
        noise = of_sample(parts[3], k)[np.ix_(there, there)]
        expected = np.zeros(count)
        if k > 0:
            ahead = move(states, None if u is None else u[k - 1])
            if auxiliary and there.size:
                # Those are moved on that the sample makes likely.
                expected = log_density(sample[there] - see(ahead, inputs)[:, there], noise)
                first = _logarithms(weights) + expected
                top = first.max()
                chance = np.exp(first - top)
                total = np.log(chance.sum()) + top
                places = chosen(random, chance / chance.sum())
                ahead, expected, weights = ahead[places], expected[places] - total, np.full(count, 1 / count)
                later.chosen(places)
            elif 1 / (weights**2).sum() < FEW * count:
                places = chosen(random, weights)
                ahead, weights = ahead[places], np.full(count, 1 / count)
                later.chosen(places)
            states = ahead + _noises(random, of_sample(parts[2], k - 1), count)
        if there.size:
            seen = see(states, inputs)[:, there]
            mean, spread = moments(seen, weights)
            likely = _logarithms(weights) + log_density(sample[there] - seen, noise) - expected
            top = likely.max()
            if not np.isfinite(top):
                raise ArithmeticError(f"the filter stops at sample {k}: no particle explains it; give more particles, or a larger `R` or `P0`")
            weights = np.exp(likely - top)
            rows.predicted(k, there, sample[there] - mean, spread + noise, float(np.log(weights.sum()) + top))
            weights = weights / weights.sum()
        rows.known(k, *moments(states, weights))
        later.known(k, states, weights)
    return {**rows.found, **later.finish(move, parts[2], u, random)}


def by_interacting_models(
    models: Sequence[Mapping[str, Numbers]], switching: Numbers, chances: Numbers, given: Given, lag: int
) -> tuple[dict[str, Any], Numbers]:
    """Interacting multiple models (Blom and Bar-Shalom 1988), and how likely each is at each sample."""
    z, x0, p0, u = given
    count, n, m = len(models), len(x0), z.shape[1]
    rows, probabilities = Rows(len(z), n, m), np.empty((len(z), count))
    means, covariances = np.array([x0] * count), np.array([p0] * count)
    later, past = Later(lag, len(z), n), list[OfModels]()
    for k, sample in enumerate(z):
        there = np.flatnonzero(~np.isnan(sample))
        if k > 0:
            mixed = switching * chances[:, None]
            chances = mixed.sum(axis=0)
            # A model that cannot be reached begins with what all know.
            shares = np.where(chances > 0, mixed / np.where(chances > 0, chances, 1.0), 1 / count)
            starts = shares.T @ means
            off = means[:, None, :] - starts[None]
            spread = covariances[:, None] + off[..., :, None] * off[..., None, :]
            covariances = np.einsum("ij,ijab->jab", shares, spread)
            means = starts
            for j, of in enumerate(models):
                f, q = of_sample(of["F"], k - 1), of_sample(of["Q"], k - 1)
                driven = 0.0 if u is None or "B" not in of else of_sample(of["B"], k - 1) @ u[k - 1]
                means[j], covariances[j] = f @ means[j] + driven, f @ covariances[j] @ f.T + q
        if there.size:
            each, fits, lefts = np.empty(count), [], []
            for j, of in enumerate(models):
                h, r = of_sample(of["H"], k)[there], of_sample(of["R"], k)[np.ix_(there, there)]
                left, s = sample[there] - h @ means[j], h @ covariances[j] @ h.T + r
                gain = np.linalg.solve(s, h @ covariances[j]).T
                each[j] = log_density(left[None], s)[0]
                fits.append(s)
                lefts.append(left)
                means[j] = means[j] + gain @ left
                covariances[j] = covariances[j] - gain @ s @ gain.T
            left, spread = moments(np.array(lefts), chances)
            s = np.einsum("j,jab->ab", chances, np.array(fits)) + spread
            joint = _logarithms(chances) + each
            top = joint.max()
            chances = np.exp(joint - top)
            rows.predicted(k, there, left, s, float(np.log(chances.sum()) + top))
            chances = chances / chances.sum()
        mean, spread = moments(means, chances)
        rows.known(k, mean, np.einsum("j,jab->ab", chances, covariances) + spread)
        probabilities[k] = chances
        if lag:
            past.append(OfModels(chances, means.copy(), covariances.copy()))
            if k >= lag:
                later.put(k - lag, of_models(past, models, switching, k - lag, u)[0])
                del past[0]
    for place, both in enumerate(of_models(past, models, switching, len(z) - len(past), u) if past else []):
        later.put(len(z) - len(past) + place, both)
    return {**rows.found, **later.found()}, probabilities


def by_backward_draws(filtered: Any, motion: Numbers, noise: Numbers, driven: Numbers | None, count: int, seed: int) -> Numbers:
    """Whole ways of the state, drawn from what all samples tell of it."""
    random, means, covariances = np.random.default_rng(seed), filtered.x, filtered.P
    found = np.empty((count, *means.shape))
    for k in range(len(means) - 1, -1, -1):
        mean, covariance = means[k], covariances[k]
        if k + 1 < len(means):
            f, q = of_sample(motion, k), of_sample(noise, k)
            crossed = covariance @ f.T
            # G = P·Fᵀ·(P⁺)⁻¹, where P⁺ may be singular.
            gain = crossed @ np.linalg.pinv(f @ crossed + q, rcond=1e-13, hermitian=True)
            ahead = f @ mean + (0.0 if driven is None else driven[k])
            mean = mean + (found[:, k + 1] - ahead) @ gain.T
            covariance = covariance - gain @ crossed.T
        found[:, k] = mean + _noises(random, covariance, count)
    return found
