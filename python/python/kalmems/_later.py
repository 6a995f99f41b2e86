"""States given later samples as well, of the filters that carry many states or several models."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from ._consistency import of_sample

Numbers: TypeAlias = NDArray[np.float64]

ALL = 2**62
"""The lag of a smoother by all samples: more of them than there are."""
DRAWS = 500
"""Ways that are drawn backwards at most."""


class Later:
    """Means and covariances of each sample given so many later ones, or all."""

    def __init__(self, lag: int, rows: int, n: int) -> None:
        self.lag, self.rows = lag, rows
        self.has_all = lag == ALL and rows > 0
        self.x: Numbers = np.empty((rows if lag else 0, n))
        self.P: Numbers = np.empty((rows if lag else 0, n, n))

    def put(self, k: int, moments: tuple[Numbers, Numbers]) -> None:
        """Those of a sample."""
        self.x[k], self.P[k] = moments

    def found(self) -> dict[str, Numbers]:
        """As parts of what a filter found; nothing without a lag."""
        return {"smoothed_x": self.x, "smoothed_P": self.P} if self.lag else {}


def unbiased(states: Numbers) -> tuple[Numbers, Numbers]:
    """Mean and covariance of the members of an ensemble."""
    return states.mean(axis=0), np.atleast_2d(np.cov(states.T))


class EnsembleLater(Later):
    """Of an ensemble: with a lag by the innovations of the later samples (Evensen and van Leeuwen 2000), with all of them backwards by the
    regression of each ensemble on the next (Raanes 2016)."""

    def __init__(self, lag: int, rows: int, n: int) -> None:
        super().__init__(lag, rows, n)
        self._kept: deque[Numbers] = deque(maxlen=None if lag == ALL else lag + 1)
        self._ahead: list[Numbers] = []

    def predicted(self, states: Numbers) -> None:
        """The ensemble before a sample that is not the first."""
        if self.has_all:
            self._ahead.append(states)

    def corrected(self, seen: Numbers, solved: Numbers) -> None:
        """Corrects the earlier ensembles by a sample: what each member sees of it, and S⁻¹ times its innovation."""
        if not self.lag or self.has_all:
            return
        off = seen - seen.mean(axis=0)
        for place, past in enumerate(self._kept):
            crossed = (past - past.mean(axis=0)).T @ off / (len(past) - 1)
            self._kept[place] = past + solved @ crossed.T

    def known(self, k: int, states: Numbers) -> None:
        """The ensemble after sample k."""
        if not self.lag:
            return
        self._kept.append(states)
        if not self.has_all and k >= self.lag:
            self.put(k - self.lag, unbiased(self._kept[0]))

    def finish(self) -> dict[str, Numbers]:
        """All that is left."""
        if self.has_all:
            states = self._kept[-1]
            self.put(self.rows - 1, unbiased(states))
            for k in range(self.rows - 2, -1, -1):
                own, ahead = self._kept[k], self._ahead[k]
                off = ahead - ahead.mean(axis=0)
                gain = (own - own.mean(axis=0)).T @ off @ np.linalg.pinv(off.T @ off, rcond=1e-12, hermitian=True)
                states = own + (states - ahead) @ gain.T
                self.put(k, unbiased(states))
        elif self.lag:
            kept = list(self._kept)
            for place, states in enumerate(kept):
                self.put(self.rows - len(kept) + place, unbiased(states))
        return self.found()


class ParticlesLater(Later):
    """Of particles: with a lag by their ancestors (Kitagawa 1996), with all samples by ways that are drawn backwards (Godsill, Doucet and West 2004)."""

    def __init__(self, lag: int, rows: int, n: int) -> None:
        super().__init__(lag, rows, n)
        self._kept: deque[Numbers] = deque(maxlen=None if lag == ALL else lag + 1)
        self._weights: list[Numbers] = []

    def chosen(self, places: NDArray[np.intp]) -> None:
        """The particles that go on."""
        if self.lag and not self.has_all:
            for place, past in enumerate(self._kept):
                self._kept[place] = past[places]

    def known(self, k: int, states: Numbers, weights: Numbers) -> None:
        """Particles and their weights after sample k."""
        if not self.lag:
            return
        self._kept.append(states)
        self._weights.append(weights)
        if not self.has_all and k >= self.lag:
            self.put(k - self.lag, weighted(self._kept[0], weights))

    def finish(self, move: Callable[[Numbers, Numbers | None], Numbers], noise: Numbers, u: Numbers | None, random: np.random.Generator) -> dict[str, Numbers]:
        """All that is left."""
        if self.has_all:
            self._backwards(move, noise, u, random)
        elif self.lag:
            kept = list(self._kept)
            for place, states in enumerate(kept):
                self.put(self.rows - len(kept) + place, weighted(states, self._weights[-1]))
        return self.found()

    def _backwards(self, move: Callable[[Numbers, Numbers | None], Numbers], noise: Numbers, u: Numbers | None, random: np.random.Generator) -> None:
        count = min(DRAWS, len(self._kept[0]))
        equal, states = np.full(count, 1 / count), np.empty((0, 0))
        for k in range(self.rows - 1, -1, -1):
            likely = np.broadcast_to(np.log(np.maximum(self._weights[k], np.finfo(float).tiny)), (count, len(self._weights[k])))
            if k + 1 < self.rows:
                q = of_sample(noise, k)
                if np.linalg.matrix_rank(q, hermitian=True) < len(q):
                    raise ValueError("particles are smoothed by all samples only if `Q` is definite; give a number of later samples, such as `smooth=20`")
                ahead = move(self._kept[k], None if u is None else u[k])
                root = np.linalg.cholesky(np.linalg.inv(q))
                left = (states @ root)[:, None, :] - (ahead @ root)[None, :, :]
                likely = likely - 0.5 * (left**2).sum(axis=2)
            chances = np.cumsum(np.exp(likely - likely.max(axis=1, keepdims=True)), axis=1)
            places = (random.uniform(size=(count, 1)) * chances[:, -1:] > chances).sum(axis=1)
            states = self._kept[k][np.minimum(places, chances.shape[1] - 1)]
            self.put(k, weighted(states, equal))


def weighted(states: Numbers, weights: Numbers) -> tuple[Numbers, Numbers]:
    """Mean and covariance of weighted rows."""
    mean = weights @ states
    off = states - mean
    return mean, (weights[:, None] * off).T @ off


@dataclass
class OfModels:
    """What interacting models know after a sample: of each model its chance, mean and covariance."""

    chances: Numbers
    means: Numbers
    covariances: Numbers

    def merged(self) -> tuple[Numbers, Numbers]:
        """Mean and covariance over the models."""
        mean, spread = weighted(self.means, self.chances)
        return mean, np.asarray(np.einsum("j,jab->ab", self.chances, self.covariances) + spread)


def of_models(
    past: Sequence[OfModels], models: Sequence[Mapping[str, Numbers]], switching: Numbers, first: int, u: Numbers | None
) -> list[tuple[Numbers, Numbers]]:
    """Means and covariances of the samples from `first` on given all that are in `past`, backwards over pairs of models (Kim 1994)."""
    count, after = len(models), past[-1]
    found = [after.merged()]
    for place in range(len(past) - 2, -1, -1):
        own, k = past[place], first + place
        joint = switching * own.chances[:, None]
        total = joint.sum(axis=0)
        # How likely model i was here and j follows, given all samples.
        pairs = joint * np.where(total > 0, after.chances / np.where(total > 0, total, 1.0), 0.0)
        means, covariances = np.empty_like(own.means), np.empty_like(own.covariances)
        chances = pairs.sum(axis=1)
        for i in range(count):
            x, p = own.means[i], own.covariances[i]
            each: list[tuple[Numbers, Numbers]] = []
            for j, of in enumerate(models):
                f, q = of_sample(of["F"], k), of_sample(of["Q"], k)
                driven: Any = 0.0 if u is None or "B" not in of else of_sample(of["B"], k) @ u[k]
                ahead = f @ p @ f.T + q
                gain = p @ f.T @ np.linalg.pinv(ahead, rcond=1e-13, hermitian=True)
                each.append((x + gain @ (after.means[j] - f @ x - driven), p + gain @ (after.covariances[j] - ahead) @ gain.T))
            shares = pairs[i] / chances[i] if chances[i] > 0 else np.full(count, 1 / count)
            means[i], covariances[i] = OfModels(shares, np.array([one[0] for one in each]), np.array([one[1] for one in each])).merged()
        after = OfModels(chances, means, covariances)
        found.append(after.merged())
    return found[::-1]
