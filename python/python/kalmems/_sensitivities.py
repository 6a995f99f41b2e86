"""How the likelihood of an extended Kalman filter depends on numbers of its model: the filter's own equations, differentiated along each number.

Mean and covariance of the state carry their derivatives by the numbers from sample to sample. Those of f, h and of ∂f/∂x, ∂h/∂x, by a number and by
the state that moves with it, are one central difference of the model's function along both, with a relative error of about 1e-10.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from ._consistency import of_sample

Numbers: TypeAlias = NDArray[np.float64]
Parts: TypeAlias = Mapping[str, Any]
"""`f`, `h`, `F` and `H` as functions of Python; `Q`, `R`, `x0` and `P0` as arrays in their shapes."""


@dataclass(frozen=True)
class Along:
    """A number of the model: the model with a little more of it, with a little less, and half the difference."""

    above: Parts
    below: Parts
    step: float


def is_followed(parts: Parts, is_compiled: Callable[[Any], bool]) -> bool:
    """Whether the sensitivities of a model's filter are known: that of an `Ekf` with derivatives in Python, without iteration and with normal noise."""
    functions = [parts.get(name) for name in ("f", "h", "F", "H")]
    plain = not any(parts.get(name) for name in ("filter", "iterated", "degrees_of_freedom"))
    return plain and all(one is not None and not is_compiled(one) for one in functions)


def slope(filtered: Any, z: Numbers, u: Numbers | None, here: Parts, numbers: Sequence[Along]) -> Numbers:
    """∂ln p(z)/∂ each number."""
    way = _Way(here, numbers)
    found = np.zeros(len(numbers))
    for k, sample in enumerate(z):
        x, p = here["x0"], here["P0"]
        if k > 0:
            x, p = way.moved((filtered.x[k - 1], filtered.P[k - 1]), k - 1, None if u is None else u[k - 1])
        there = np.flatnonzero(~np.isnan(sample))
        if there.size:
            found += way.measured((x, p), sample, there, (k, bool(filtered.taken[k]), None if u is None else u[k]))
    return found


class _Way:
    """The derivatives of the state's mean, of the shape (p, n), and of its covariance, of the shape (p, n, n), by p numbers."""

    def __init__(self, here: Parts, numbers: Sequence[Along]) -> None:
        self._here, self._numbers = here, numbers
        self.dx, self.dp = self._of_array("x0", None), self._of_array("P0", None)

    def _of_array(self, name: str, sample: int | None) -> Numbers:
        def value(parts: Parts) -> Numbers:
            return np.asarray(parts[name] if sample is None else of_sample(parts[name], sample))

        return np.stack([(value(one.above) - value(one.below)) / (2 * one.step) for one in self._numbers])

    def _of_function(self, name: str, x: Numbers, u: Numbers | None, shape: tuple[int, ...]) -> Numbers:
        """The derivative of a function's value by each number, with the state that moves with it."""
        return np.stack(
            [
                (_value(one.above[name], x + one.step * dx, u, shape) - _value(one.below[name], x - one.step * dx, u, shape)) / (2 * one.step)
                for one, dx in zip(self._numbers, self.dx, strict=True)
            ]
        )

    def moved(self, state: tuple[Numbers, Numbers], sample: int, u: Numbers | None) -> tuple[Numbers, Numbers]:
        """Predicts the derivatives to the next sample; gives the predicted mean and covariance."""
        x, p = state
        n = x.size
        motion, turned = _value(self._here["F"], x, u, (n, n)), self._of_function("F", x, u, (n, n))
        ahead = turned @ p @ motion.T
        self.dp = ahead + ahead.transpose(0, 2, 1) + motion @ self.dp @ motion.T + self._of_array("Q", sample)
        self.dx = self._of_function("f", x, u, (n,))
        return _value(self._here["f"], x, u, (n,)), motion @ p @ motion.T + of_sample(self._here["Q"], sample)

    def measured(self, state: tuple[Numbers, Numbers], z: Numbers, there: NDArray[np.intp], at: tuple[int, bool, Numbers | None]) -> Numbers:
        """∂ln p of a sample by each number; corrects the derivatives if the sample corrected the state."""
        (x, p), (k, is_taken, u) = state, at
        n, m, both = x.size, z.size, np.ix_(there, there)
        sensor, turned = _value(self._here["H"], x, u, (m, n))[there], self._of_function("H", x, u, (m, n))[:, there]
        left, dleft = (z - _value(self._here["h"], x, u, (m,)))[there], -self._of_function("h", x, u, (m,))[:, there]
        crossed = p @ sensor.T
        dcrossed = self.dp @ sensor.T + p @ turned.transpose(0, 2, 1)
        inverse = np.linalg.inv(sensor @ crossed + of_sample(self._here["R"], k)[both])
        ds = turned @ crossed + sensor @ dcrossed + self._of_array("R", k)[:, there][:, :, there]
        white = inverse @ left
        found = 0.5 * (white @ ds @ white - np.einsum("ij,pji->p", inverse, ds)) - dleft @ white
        if is_taken:
            gain = crossed @ inverse
            dgain = (dcrossed - gain @ ds) @ inverse
            self.dx = self.dx + dleft @ gain.T + dgain @ left
            fallen = dcrossed @ gain.T
            self.dp = self.dp - fallen - fallen.transpose(0, 2, 1) + gain @ ds @ gain.T
        return np.asarray(found)


def _value(function: Callable[..., Any], x: Numbers, u: Numbers | None, shape: tuple[int, ...]) -> Numbers:
    return np.asarray(function(x) if u is None else function(x, u), dtype=np.float64).reshape(shape)
