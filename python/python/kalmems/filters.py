"""Kalman filters over arrays, for linear systems and for models of one's own.

`kalman` is the filter of a linear system and `constant_gain` that of a gain for all samples, such as that of `steady`. `Ekf`, `Ukf`, `Ensemble` and
`Particles` are the filters of functions, which `Equations` makes of text with units and `symbolic` of expressions of SymPy. `interacting` is the filter of
a system that switches, and `posterior` draws ways of the state. `from_state_space` takes systems of SciPy and python-control, and `together` merges
sensors of different times. `fit` and `em` learn numbers that are not known, `consistency` simulates whether claims hold, and `verdict` grades a filter
from its innovations. Filters of matrices and of compiled functions leave the interpreter's lock, so that threads run several at once.

Shapes are written with n states, m measurements, k inputs and N samples. Units are the caller's own: a covariance has the square of the unit of what it
is of, and `F` is per step, from a sample to the next. Arrays of JAX, PyTorch and whatever else NumPy reads are arrays.

What is known before, `x0` and `P0`, is of the first sample before it is taken: that is updated with first, and each further sample is predicted
and then updated with. Numbers of a sample that are not one are missing: the others correct the state, and where all are missing it is predicted only.
So sensors of different rates share the rows of all their times, and rows of `nan` at the end are a forecast. There are up to 24 states and 16
measurements, and up to 12 states for `Ukf` and an iterated `Ekf`.

Before it runs, a model is checked: numbers are finite, covariances symmetric (to 1e-12 of their largest element) and without negative eigenvalues,
functions give arrays of the right shapes, and derivatives agree with difference quotients at `x0`. Functions are checked in the first run alone.
`check=False` leaves the checks out.
"""

from __future__ import annotations

import ctypes
import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _consistency, _fit, _kalmems, _model_checks, _sampled, _scores, _sensitivities, _systems, _verdict
from ._consistency import Consistency
from ._equations import Equations, symbolic
from ._fit import Fit, Learned, Likelihood
from ._later import ALL
from ._systems import Steady, from_state_space, to_state_space, together
from ._verdict import FilterVerdict, Finding

__all__ = [
    "Consistency",
    "Ekf",
    "Ensemble",
    "Equations",
    "FilterVerdict",
    "Filtered",
    "Finding",
    "Fit",
    "Learned",
    "Likelihood",
    "Particles",
    "Smoothed",
    "Steady",
    "Ukf",
    "consistency",
    "constant_gain",
    "em",
    "fit",
    "from_state_space",
    "interacting",
    "kalman",
    "likelihood",
    "posterior",
    "steady",
    "symbolic",
    "to_state_space",
    "together",
    "verdict",
]

_SIGNATURE = "void(CPointer(float64), CPointer(float64), CPointer(float64))"

Numbers = NDArray[np.float64]
Function: TypeAlias = Callable[..., Any]
"""A function of Python, `f(x)` or with inputs `f(x, u)`, or one compiled by `numba.cfunc`; see `Ekf`."""


@dataclass(frozen=True, eq=False, repr=False)
class Smoothed:
    """The state at each sample given later samples, by the smoother of Rauch, Tung and Striebel.

    Examples
    --------
    >>> found = kalman([1.0, 3.0], F=1, H=1, Q=1, R=1, x0=0, P0=1, smooth=True)
    >>> found.smoothed
    <Smoothed: 2 samples of 1 state>
    >>> found.smoothed.x.ravel().round(3).tolist()
    [1.0, 2.0]
    """

    x: Numbers
    """The mean of the state, of the shape (N, n)."""
    P: Numbers
    """Its covariance, of the shape (N, n, n)."""

    @property
    def sd(self) -> Numbers:
        """The standard deviations of the state, of the shape (N, n)."""
        return np.sqrt(np.diagonal(self.P, axis1=1, axis2=2))

    def __len__(self) -> int:
        """The number of samples."""
        return len(self.x)

    def __repr__(self) -> str:
        return f"<Smoothed: {_counted(len(self), 'sample')} of {_counted(self.x.shape[1], 'state')}>"


@dataclass(frozen=True, eq=False, repr=False)
class Filtered:
    """The state at each sample given the samples until then, and how well the filter predicted them.

    Examples
    --------
    >>> found = kalman([1.0, np.nan, 3.0], F=1, H=1, Q=1, R=1, x0=0, P0=1)
    >>> found
    <Filtered: 3 samples of 1 state and 1 measurement, 1 of them without an update, log-likelihood -3.95369>
    >>> found.innovation.ravel().tolist()
    [1.0, nan, 2.5]
    """

    x: Numbers
    """The mean of the state, of the shape (N, n)."""
    P: Numbers
    """Its covariance, of the shape (N, n, n)."""
    innovation: Numbers
    """z − h(x⁻), of the shape (N, m); not a number if a sample is missing."""
    S: Numbers
    """The covariance that the filter gives the innovation, of the shape (N, m, m)."""
    nis: Numbers
    """The normalised innovation squared, of the shape (N,): m on average for a consistent filter."""
    log_likelihood: Numbers
    """ln p(z | past) of each sample, of the shape (N,)."""
    taken: NDArray[np.bool_]
    """Whether a sample has corrected the state, of the shape (N,)."""
    smoothed: Smoothed | None = None
    """The state given later samples as well, if `smooth` asked for it."""
    models: Numbers | None = None
    """How likely each of the models of `interacting` is, of the shape (N, count)."""

    @property
    def sd(self) -> Numbers:
        """The standard deviations of the state, of the shape (N, n)."""
        return np.sqrt(np.diagonal(self.P, axis1=1, axis2=2))

    def __len__(self) -> int:
        """The number of samples."""
        return len(self.x)

    def __repr__(self) -> str:
        of = f"{_counted(self.x.shape[1], 'state')} and {_counted(self.innovation.shape[1], 'measurement')}"
        is_missing = np.isnan(self.log_likelihood)
        missing, rejected = int(is_missing.sum()), int((~self.taken & ~is_missing).sum())
        without = f", {missing} of them without an update" if missing else ""
        without += f", {rejected} of them rejected" if rejected else ""
        likelihood = f"{np.nansum(self.log_likelihood):.6g}"
        return f"<Filtered: {_counted(len(self), 'sample')} of {of}{without}, log-likelihood {likelihood}>"


def _counted(count: int, noun: str) -> str:
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"


def kalman(
    z: ArrayLike,
    F: ArrayLike,
    H: ArrayLike,
    Q: ArrayLike,
    R: ArrayLike,
    x0: ArrayLike,
    P0: ArrayLike,
    *,
    B: ArrayLike | None = None,
    u: ArrayLike | None = None,
    smooth: bool | int = False,
    largest_nis: float | None = None,
    degrees_of_freedom: float | None = None,
    square_root: bool = False,
    check: bool = True,
) -> Filtered:
    """The Kalman filter of the linear system x′ = F·x + B·u + w, z = H·x + v.

    Each of F, H, Q, R and B may be an array for each sample, with an axis of N before the others: F, Q and B of sample i lead to i + 1.

    Parameters
    ----------
    z : array of the shape (N, m), or (N,) for a single measurement
        Samples, a row each, in the unit of the measurement. Masked ones and those that are not a number are missing.
    F : array of the shape (n, n)
        How the state changes from a sample to the next; a vector is its diagonal.
    H : array of the shape (m, n)
        The measurement per state; a vector if m or n is 1.
    Q : array of the shape (n, n)
        The covariance of the process noise w of a step; a vector is its diagonal.
    R : array of the shape (m, m)
        The covariance of the noise v of a sample; a vector is its diagonal.
    x0 : array of the shape (n,)
        The mean of the state at the first sample, before that is taken.
    P0 : array of the shape (n, n)
        Its covariance; a vector is its diagonal.
    B : array of the shape (n, k), optional
        The change of the state per input.
    u : array of the shape (N, k), or (N,) for a single input, optional
        Inputs; `u[i]` acts from sample i to i + 1.
    smooth : bool or int
        Whether to give the state given all samples as well, or given so many later ones.
    largest_nis : float, optional
        A sample with a larger normalised innovation squared is rejected: it does not correct the state.
    degrees_of_freedom : float, optional
        Those of Student's t distribution of the noise of samples, above 2, such as 4; R is then the square of its scale, and a sample with a large
        innovation corrects the state less. Normal noise if left out.
    square_root : bool
        Whether the covariance is held as a factor, which keeps it definite where it is all but singular.
    check : bool
        Whether to check covariances and numbers before.

    Returns
    -------
    Filtered

    Examples
    --------
    A position in m that is measured with a standard deviation of 0.1 m every 0.5 s, and a velocity in m/s that is not measured:

    >>> found = kalman(
    ...     z=[0.0, 1.1, 1.9, 3.0], F=[[1, 0.5], [0, 1]], H=[1, 0], Q=[0, 1e-6], R=0.1**2, x0=[0, 0], P0=[1, 10],
    ... )
    >>> found.x[-1].round(2).tolist(), found.sd[-1].round(2).tolist()
    ([2.97, 1.96], [0.08, 0.09])
    """
    rows, states = _samples(z), _vector("x0", x0)
    n, m = states.size, rows.shape[1]
    inputs = None if u is None else _rows("u", u)
    gain = None if B is None else _matrix("B", B, n, None if inputs is None else inputs.shape[1])
    if (inputs is None) != (gain is None):
        raise ValueError("`B` and `u` belong together; give both or none")
    motion, sensor, noise = _matrix("F", F, n, n), _matrix("H", H, m, n), (_matrix("Q", Q, n, n), _matrix("R", R, m, m))
    before = _matrix("P0", P0, n, n)
    if check:
        _check_numbers(rows, inputs, states, before, *noise)
        _model_checks.finite(F=motion, H=sensor, B=gain)
    manner = _manner("square_root_ekf" if square_root else "ekf", _STANDARD, (largest_nis, degrees_of_freedom), smooth)
    return _filtered(_kalmems.kalman(rows, motion, sensor, *noise, states, before, gain, inputs, manner), degrees_of_freedom)


Limits: TypeAlias = tuple[float | None, float | None]
"""The largest NIS of a sample that is taken, and the degrees of freedom of its noise."""
_STANDARD = (1.0, 2.0, 1.0)
"""The spread α, β, κ of sigma points."""
_MEASUREMENTS = 16
"""The most measurements of a sample."""


def _manner(
    method: str, points: tuple[float, float, float], limits: Limits, smooth: bool | int
) -> tuple[str, tuple[float, float, float], tuple[float, float], int]:
    """The method, sigma points, limits of samples and number of later samples with which the compiled filter is called."""
    largest_nis, degrees_of_freedom = limits
    if degrees_of_freedom is not None and not degrees_of_freedom > 2:
        why = "a distribution with 2 or fewer has no variance, and 4 is usual"
        raise ValueError(f"`degrees_of_freedom` is {degrees_of_freedom}; expected more than 2: {why}")
    if largest_nis is not None and not largest_nis > 0:
        raise ValueError(f"`largest_nis` is {largest_nis}; the NIS of a right filter is m on average, and its limit is above that, such as 25")
    lag = _lag(smooth)
    bounds = (np.inf if limit is None else float(limit) for limit in limits)
    return method, points, (next(bounds), next(bounds)), lag


def _lag(smooth: bool | int) -> int:
    """The number of later samples by which a state is smoothed."""
    if not isinstance(smooth, bool) and (not isinstance(smooth, int) or smooth < 1):
        raise ValueError(f"`smooth` is {smooth!r}; give `True` for all later samples, or a number of samples such as 20")
    return ALL if smooth is True else int(smooth)


def _check_numbers(z: Numbers, u: Numbers | None, x0: Numbers, p0: Numbers, q: Numbers, r: Numbers) -> None:
    _model_checks.measured(z)
    _model_checks.finite(u=u, x0=x0, P0=p0, Q=q, R=r)
    for name, matrix in (("P0", p0), ("Q", q), ("R", r)):
        _model_checks.covariance(name, matrix)


def _filtered(found: dict[str, Any], degrees_of_freedom: float | None) -> Filtered:
    if degrees_of_freedom is not None:
        found["log_likelihood"] = _of_student(found, degrees_of_freedom)
    x, covariance = found.pop("smoothed_x", None), found.pop("smoothed_P", None)
    smoothed = None if x is None or covariance is None else Smoothed(x, covariance)
    return Filtered(**found, smoothed=smoothed)


def _of_student(found: dict[str, Any], freedom: float) -> Numbers:
    """ln p of samples of Student's t distribution with the scale S: ln |S| is what the normal density has of it."""
    m = (~np.isnan(found["innovation"])).sum(axis=1)
    ends = np.array([math.lgamma((freedom + count) / 2) - math.lgamma(freedom / 2) for count in range(_MEASUREMENTS + 1)])
    determinant = -2 * found["log_likelihood"] - found["nis"] - m * np.log(2 * np.pi)
    tail = (freedom + m) / 2 * np.log1p(found["nis"] / freedom)
    return np.asarray(ends[m] - 0.5 * (m * np.log(freedom * np.pi) + determinant) - tail)


def steady(F: ArrayLike, H: ArrayLike, Q: ArrayLike, R: ArrayLike) -> Steady:
    """The gain and the covariances that the filter of a linear system settles to.

    Parameters
    ----------
    F, H, Q, R
        As of `kalman`, none of them for each sample, and H with as many columns as F.

    Returns
    -------
    Steady

    Examples
    --------
    >>> found = steady(F=1, H=1, Q=1, R=1)
    >>> found.K.round(4).item(), found.predicted.round(4).item()
    (0.618, 1.618)
    """
    motion = _model_checks.numbers("`F`", F)
    n = 1 if motion.ndim == 0 else len(motion)
    sensor = _model_checks.numbers("`H`", H)
    m = max(1, sensor.size // n) if sensor.ndim < 2 else len(sensor)
    parts = {"F": _matrix("F", motion, n, n), "H": _matrix("H", sensor, m, n), "Q": _matrix("Q", Q, n, n), "R": _matrix("R", R, m, m)}
    for name, shape in {"F": (n, n), "H": (m, n), "Q": (n, n), "R": (m, m)}.items():
        if parts[name].shape != shape:
            raise ValueError(f"`{name}` has the shape {parts[name].shape}; expected {shape}")
    _model_checks.finite(**parts)
    for name in ("Q", "R"):
        _model_checks.covariance(name, parts[name])
    return _systems.settled(parts["F"], parts["H"], parts["Q"], parts["R"])


def constant_gain(
    z: ArrayLike,
    F: ArrayLike,
    H: ArrayLike,
    Q: ArrayLike,
    R: ArrayLike,
    x0: ArrayLike,
    P0: ArrayLike,
    *,
    gain: ArrayLike | None = None,
    B: ArrayLike | None = None,
    u: ArrayLike | None = None,
) -> Filtered:
    """The filter of a linear system with one gain for all samples: an observer, an α-β filter, or the settled Kalman filter.

    Its covariance is that of the errors with this gain, and larger than with the gains of `kalman`. Its innovations are white with the settled gain
    alone: give `whitens=False` to `verdict` with another one.

    Parameters
    ----------
    z, F, H, Q, R, x0, P0, B, u
        As of `kalman`.
    gain : array of the shape (n, m), optional
        The change of the state per innovation; that of `steady` if left out.

    Returns
    -------
    Filtered

    Examples
    --------
    An α-β filter, with α = 0.5 and β = 0.1:

    >>> found = constant_gain([0.0, 1.0, 2.1], F=[[1, 1], [0, 1]], H=[1, 0], Q=[0, 0.1], R=1, x0=[0, 0], P0=[1, 1], gain=[0.5, 0.1])
    >>> found.x[-1].round(3).tolist(), found.innovation.ravel().round(3).tolist()
    ([1.35, 0.25], [0.0, 1.0, 1.5])
    """
    rows, inputs = _samples(z), None if u is None else _rows("u", u)
    given = {"F": F, "H": H, "Q": Q, "R": R, "x0": x0, "P0": P0, "B": B}
    parts = _matrices(given, rows.shape[1], inputs)
    n, m = parts["x0"].size, rows.shape[1]
    _check_numbers(rows, inputs, parts["x0"], parts["P0"], parts["Q"], parts["R"])
    for name, shape in {"F": (n, n), "H": (m, n), "Q": (n, n), "R": (m, m), "P0": (n, n)}.items():
        if parts[name].shape not in (shape, (len(rows), *shape)):
            raise ValueError(f"`{name}` has the shape {parts[name].shape}; expected {shape} or {(len(rows), *shape)}")
    kept = steady(F, H, Q, R).K if gain is None else _matrix("gain", gain, n, m)
    if kept.shape != (n, m):
        raise ValueError(f"`gain` has the shape {kept.shape}; expected ({n}, {m})")
    driven = None if inputs is None or "B" not in parts else (parts["B"] @ inputs[..., None])[..., 0]
    return Filtered(**_systems.with_gain(parts, rows, kept, driven))


def verdict(
    found: Filtered | ArrayLike,
    S: ArrayLike | None = None,
    *,
    times: ArrayLike | None = None,
    interval: float | None = None,
    names: Sequence[str] | None = None,
    motions_hz: ArrayLike = (),
    whitens: bool = True,
) -> FilterVerdict:
    """Whether innovations contradict what a filter claims, by the tests and with the grade of `Experiment.estimate`: of any filter, of any library.

    Parameters
    ----------
    found : Filtered, or array of the shape (N, m) or (N,)
        What a filter found, or the innovations z − h(x⁻); those that are not a number did not correct the state.
    S : array of the shape (m, m), (N, m, m) or (N,)
        The covariance that the filter gives an array of innovations.
    times : array of the shape (N,), optional
        The times of the samples in s, with which the sentences are written.
    interval : float, optional
        Seconds from a sample to the next in place of `times`; 1 if both are left out.
    names : sequence of str, optional
        The names of the measurements.
    motions_hz : float or array
        Frequencies in Hz of a motion, which is then sought in the innovations with its harmonics.
    whitens : bool
        Whether the innovations of a consistent filter are white, which those of a gain that is not optimal are not: their size alone is tested then.

    Returns
    -------
    FilterVerdict

    Examples
    --------
    A level that walks, by a filter with the true noise and by one with a hundredth of it:

    >>> random = np.random.default_rng(1)
    >>> z = np.cumsum(random.normal(0, 0.1, 2000)) + random.normal(0, 0.5, 2000)
    >>> [verdict(kalman(z, F=1, H=1, Q=0.01, R=r, x0=0, P0=1)).grade for r in (0.25, 0.0025)]
    ['passes', 'failed']
    """
    innovation, s, nis, taken = _innovations(found, S)
    return _verdict.judged((innovation, s, nis, taken), _verdict.times_of(len(innovation), times, interval), names, motions_hz, whitens)


def _innovations(found: Filtered | ArrayLike, S: ArrayLike | None) -> tuple[Numbers, Numbers, Numbers, NDArray[np.bool_]]:
    if isinstance(found, Filtered):
        return found.innovation, found.S, found.nis, found.taken
    if S is None:
        raise ValueError("the innovations have no covariance; give `S` as well")
    rows = _rows("found", found)
    m, given = rows.shape[1], _model_checks.numbers("`S`", S)
    given = given.reshape(-1, 1, 1) if given.ndim < 2 and m == 1 else given
    if given.shape[-2:] != (m, m) or given.shape[:-2] not in ((), (1,), (len(rows),)):
        raise ValueError(f"`S` has the shape {given.shape}; expected ({m}, {m}) or ({len(rows)}, {m}, {m})")
    s = np.broadcast_to(given, (len(rows), m, m))
    there = np.isfinite(rows)
    both = there[:, :, None] & there[:, None, :]
    left = np.where(there, rows, 0.0)
    solved = np.linalg.solve(np.where(both, s, 0.0) + np.eye(m) * ~there[:, None, :], left[..., None])[..., 0]
    return np.asarray(np.where(there, rows, np.nan)), s, np.asarray((left * solved).sum(axis=1)), np.asarray(there.any(axis=1))


class _Nonlinear:
    def __init__(
        self,
        functions: dict[str, Function | None],
        noise: tuple[ArrayLike, ArrayLike],
        manner: tuple[str, tuple[float, float, float], Limits],
        check: bool,
    ) -> None:
        self._functions = functions
        for name, function in self._functions.items():
            if function is not None or name in ("f", "h"):
                _model_checks.function(name, function)
        self._q, self._r = noise
        self._manner = manner
        self._is_to_check, self._is_checked = check, False

    def run(
        self, z: ArrayLike, x0: ArrayLike, P0: ArrayLike, u: ArrayLike | None = None, *, smooth: bool | int = False
    ) -> Filtered:
        """Filters samples.

        Parameters
        ----------
        z : array of the shape (N, m), or (N,) for a single measurement
            Samples, a row each, in the unit of the measurement. Masked ones and those that are not a number are missing.
        x0 : array of the shape (n,)
            The mean of the state at the first sample, before that is taken.
        P0 : array of the shape (n, n)
            Its covariance; a vector is its diagonal.
        u : array of the shape (N, k), or (N,) for a single input, optional
            Inputs; `u[i]` acts from sample i to i + 1, and `h` sees it at i.
        smooth : bool or int
            Whether to give the state given all samples as well, or given so many later ones.

        Returns
        -------
        Filtered
        """
        rows, states = _samples(z), _vector("x0", x0)
        n, m = states.size, rows.shape[1]
        compiled = [_is_compiled(function) for function in self._functions.values() if function is not None]
        if any(compiled) != all(compiled):
            raise ValueError("some functions of the model are compiled and some are not; give all of one kind")
        functions = [None if function is None else _handed_over(name, function) for name, function in self._functions.items()]
        inputs = None if u is None else _rows("u", u)
        noise, before = (_matrix("Q", self._q, n, n), _matrix("R", self._r, m, m)), _matrix("P0", P0, n, n)
        if self._is_to_check:
            _check_numbers(rows, inputs, states, before, *noise)
            self._check_functions(states, before, m, None if inputs is None or len(inputs) == 0 else inputs[0])
        manner = _manner(*self._manner, smooth)
        return _filtered(_kalmems.nonlinear(rows, functions, *noise, states, before, inputs, manner), self._manner[2][1])

    def _check_functions(self, x0: Numbers, p0: Numbers, m: int, u: Numbers | None) -> None:
        """Refuses functions that give other shapes, and derivatives that differ from difference quotients, at `x0` of the first run."""
        n = x0.size
        if self._is_checked or p0.shape != (n, n):
            return
        sd = np.sqrt(np.diag(p0))
        scales = np.where(sd > 0, sd, 1.0)
        for of, name, count in (("f", "F", n), ("h", "H", m)):
            function, derivative = self._functions[of], self._functions[name]
            if function is None:
                continue
            value = self._at(of, function, u, count)
            _model_checks.value(of, value(x0), count)
            if derivative is not None:
                given = self._at(name, derivative, u, count * n)(x0)
                given = _model_checks.slope(name, given, count, n, _is_compiled(derivative))
                _model_checks.derivative(name, of, given, value, x0, scales)
        self._is_checked = True

    def _at(self, name: str, function: Function, u: Numbers | None, count: int) -> _model_checks.Evaluated:
        is_compiled = _is_compiled(function)
        if not is_compiled:
            _model_checks.arguments(name, function, u is not None)
        return _model_checks.evaluated(name, function, u, count, is_compiled)

    def __repr__(self) -> str:
        parts = [f"{name}={_named(function)}" for name, function in self._functions.items() if function is not None]
        method, points, limits = self._manner
        if "ukf" in method:
            parts += [f"{name}={value:g}" for name, value in zip(("alpha", "beta", "kappa"), points, strict=True)]
        parts += [f"{name}={np.asarray(noise).tolist()}" for name, noise in (("Q", self._q), ("R", self._r))]
        parts += [f"{word}=True" for word in ("square_root", "iterated") if method.startswith(word)]
        parts += [f"{name}={limit:g}" for name, limit in zip(("largest_nis", "degrees_of_freedom"), limits, strict=True) if limit is not None]
        return f"{type(self).__name__}({', '.join(parts)})"


def _named(function: Function) -> str:
    return str(getattr(function, "__name__", type(function).__name__))


class Ekf(_Nonlinear):
    """The extended Kalman filter of the model x′ = f(x, u) + w, z = h(x, u) + v.

    Parameters
    ----------
    f : function
        The next state, of the shape (n,), as a function of the state and, if `run` is given inputs, of those: `f(x)` or `f(x, u)`.
    h : function
        The measurement, of the shape (m,): `h(x)` or `h(x, u)`.
    Q : array of the shape (n, n)
        The covariance of the process noise w of a step; a vector is its diagonal.
    R : array of the shape (m, m)
        The covariance of the noise v of a sample; a vector is its diagonal.
    F, H : functions, optional
        The derivatives ∂f/∂x of the shape (n, n) and ∂h/∂x of the shape (m, n); central differences if left out.
    iterated : bool
        Whether each measurement is linearised again where it leads, until that settles.
    square_root : bool
        Whether the covariance is held as a factor, which keeps it definite where it is all but singular.
    largest_nis : float, optional
        A sample with a larger normalised innovation squared is rejected: it does not correct the state.
    degrees_of_freedom : float, optional
        Those of Student's t distribution of the noise of samples, above 2, such as 4; R is then the square of its scale, and a sample with a large
        innovation corrects the state less. Normal noise if left out.
    check : bool
        Whether to check covariances, shapes and derivatives before the first run.

    Q and R may be an array for each sample, with an axis of N before the others.

    Notes
    -----
    Functions of Python get arrays and give one. At native speed run functions that
    `numba.cfunc("void(CPointer(float64), CPointer(float64), CPointer(float64))")` compiles: `f(x, u, out)`, all as pointers, with matrices row
    after row in `out`. A function of `ctypes` with `argtypes` of three `POINTER(c_double)` and the `restype` `None` is taken as well. The check
    calls it once and a few times more for the differences.

    Examples
    --------
    An angle in rad and its rate in rad/s, of a pendulum whose sine is measured every 10 ms:

    >>> def f(x):
    ...     return [x[0] + 0.01 * x[1], x[1] - 0.01 * np.sin(x[0])]
    >>> def h(x):
    ...     return [np.sin(x[0])]
    >>> pendulum = Ekf(f, h, Q=[0, 1e-8], R=1e-4)
    >>> pendulum
    Ekf(f=f, h=h, Q=[0.0, 1e-08], R=0.0001)
    >>> found = pendulum.run(np.sin(0.5 * np.cos(0.01 * np.arange(300))), x0=[0.4, 0], P0=[0.1, 0.1])
    >>> found.x[-1].round(1).tolist()
    [-0.5, -0.1]
    """

    def __init__(
        self,
        f: Function,
        h: Function,
        *,
        Q: ArrayLike,
        R: ArrayLike,
        F: Function | None = None,
        H: Function | None = None,
        iterated: bool = False,
        square_root: bool = False,
        largest_nis: float | None = None,
        degrees_of_freedom: float | None = None,
        check: bool = True,
    ) -> None:
        if iterated and square_root:
            raise ValueError("there is no iterated filter in square-root form; leave `iterated` or `square_root` out")
        method = "iterated_ekf" if iterated else "square_root_ekf" if square_root else "ekf"
        super().__init__({"f": f, "F": F, "h": h, "H": H}, (Q, R), (method, _STANDARD, (largest_nis, degrees_of_freedom)), check)


class Ukf(_Nonlinear):
    """The unscented Kalman filter of the model x′ = f(x, u) + w, z = h(x, u) + v, without derivatives.

    Parameters
    ----------
    f, h, Q, R, square_root, largest_nis, degrees_of_freedom, check
        As those of `Ekf`.
    alpha, beta, kappa : float
        The spread α, β, κ of the sigma points, without a unit.

    Examples
    --------
    The logarithm of a number that drifts is measured:

    >>> filter = Ukf(lambda x: x, lambda x: np.log(x), Q=1e-6, R=1e-4)
    >>> filter.run(np.log([2.0, 2.0, 2.0]), x0=1.5, P0=0.1).x[-1].round(2).tolist()
    [2.0]
    """

    def __init__(
        self,
        f: Function,
        h: Function,
        *,
        Q: ArrayLike,
        R: ArrayLike,
        alpha: float = 1.0,
        beta: float = 2.0,
        kappa: float = 1.0,
        square_root: bool = False,
        largest_nis: float | None = None,
        degrees_of_freedom: float | None = None,
        check: bool = True,
    ) -> None:
        if not alpha > 0:
            raise ValueError(f"`alpha` is {alpha:g}; the spread of the sigma points is above 0, such as 1")
        method = "square_root_ukf" if square_root else "ukf"
        functions: dict[str, Function | None] = {"f": f, "F": None, "h": h, "H": None}
        super().__init__(functions, (Q, R), (method, (alpha, beta, kappa), (largest_nis, degrees_of_freedom)), check)


class _Sampled:
    def __init__(self, f: Function, h: Function, *, Q: ArrayLike, R: ArrayLike, members: int = 1000, seed: int = 0) -> None:
        for name, function in (("f", f), ("h", h)):
            _model_checks.function(name, function)
            if _is_compiled(function):
                raise TypeError(f"`{name}` is compiled; give a function of Python, which is called with all states at once where it can be")
        if members < 2:
            raise ValueError(f"`members` is {members}; expected 2 or more, such as 1000")
        self._f, self._h, self._q, self._r, self._members, self._seed = f, h, Q, R, members, seed

    def run(self, z: ArrayLike, x0: ArrayLike, P0: ArrayLike, u: ArrayLike | None = None, *, smooth: bool | int = False) -> Filtered:
        """Filters samples.

        Parameters
        ----------
        z, x0, P0, u, smooth
            As of `Ekf.run`. Particles are smoothed by all samples only if Q is definite.

        Returns
        -------
        Filtered
            Mean and covariance are those of the members, and `log_likelihood` is an estimate by them.
        """
        rows, states = _samples(z), _vector("x0", x0)
        n, m = states.size, rows.shape[1]
        before, noise = _matrix("P0", P0, n, n), (_matrix("Q", self._q, n, n), _matrix("R", self._r, m, m))
        inputs = None if u is None else _rows("u", u)
        _check_numbers(rows, inputs, states, before, *noise)
        return _filtered(self._found((self._f, self._h, *noise), (rows, states, before, inputs), _lag(smooth)), None)

    def _found(self, parts: _sampled.Parts, given: _sampled.Given, lag: int) -> dict[str, Any]:
        raise NotImplementedError

    def __repr__(self) -> str:
        return f"{type(self).__name__}(f={_named(self._f)}, h={_named(self._h)}, members={self._members}, seed={self._seed})"


class Ensemble(_Sampled):
    """The ensemble Kalman filter (Evensen 1994, with perturbed samples) of the model x′ = f(x, u) + w, z = h(x, u) + v.

    Parameters
    ----------
    f, h, Q, R
        As those of `Ekf`. Functions that give the right numbers for states of the shape (n, members) are called once for all of them.
    members : int
        States that are carried.
    seed : int
        Of the random numbers.

    Examples
    --------
    >>> walk = Ensemble(lambda x: x, lambda x: x, Q=0.01, R=1.0, members=4000)
    >>> found = walk.run([1.0, 1.0, 1.0], x0=0, P0=1)
    >>> found.x[-1].round(1).tolist(), found.sd[-1].round(1).tolist()
    ([0.8], [0.5])
    """

    def _found(self, parts: _sampled.Parts, given: _sampled.Given, lag: int) -> dict[str, Any]:
        return _sampled.by_ensemble(parts, given, self._members, self._seed, lag)


class Particles(_Sampled):
    """The bootstrap particle filter (Gordon, Salmond and Smith 1993) of the model x′ = f(x, u) + w, z = h(x, u) + v.

    Particles are drawn anew, systematically, where less than half of them count.

    Parameters
    ----------
    f, h, Q, R
        As those of `Ekf`. Functions that give the right numbers for states of the shape (n, members) are called once for all of them.
    members : int
        Particles.
    auxiliary : bool
        Whether those are moved on that the next sample makes likely (Pitt and Shephard 1999), which suits a small process noise.
    seed : int
        Of the random numbers.

    Examples
    --------
    The size of a number is measured, and not its sign:

    >>> found = Particles(lambda x: x, lambda x: np.abs(x), Q=1e-4, R=0.01, members=4000).run(np.ones(20), x0=0, P0=4)
    >>> bool(abs(found.x[-1, 0]) < 0.3), found.sd[-1].round(1).tolist()
    (True, [1.0])
    """

    def __init__(
        self, f: Function, h: Function, *, Q: ArrayLike, R: ArrayLike, members: int = 1000, auxiliary: bool = False, seed: int = 0
    ) -> None:
        super().__init__(f, h, Q=Q, R=R, members=members, seed=seed)
        self._is_auxiliary = auxiliary

    def _found(self, parts: _sampled.Parts, given: _sampled.Given, lag: int) -> dict[str, Any]:
        return _sampled.by_particles(parts, given, self._members, self._is_auxiliary, self._seed, lag)


def interacting(
    z: ArrayLike,
    models: Sequence[Mapping[str, ArrayLike]],
    switching: ArrayLike,
    x0: ArrayLike,
    P0: ArrayLike,
    *,
    u: ArrayLike | None = None,
    chances: ArrayLike | None = None,
    smooth: bool | int = False,
) -> Filtered:
    """Interacting multiple models (Blom and Bar-Shalom 1988): a linear system that switches between some.

    Parameters
    ----------
    z, x0, P0, u
        As of `kalman`.
    models : sequence of mappings
        Of each model `F`, `H`, `Q`, `R`, and `B` if there are inputs, as of `kalman`.
    switching : array of the shape (count, count)
        The probability with which a row's model is followed by a column's from a sample to the next.
    chances : array of the shape (count,), optional
        How likely each is at first; all alike if left out.
    smooth : bool or int
        As of `kalman`, by pairs of models (Kim 1994), which is an approximation as the filter is.

    Returns
    -------
    Filtered
        With `models`, how likely each is at each sample.

    Examples
    --------
    A level that stays, and from sample 20 on walks:

    >>> random = np.random.default_rng(1)
    >>> level = np.concatenate([np.zeros(20), np.cumsum(random.normal(0, 2, 20))])
    >>> still, walking = ({"F": 1, "H": 1, "Q": q, "R": 0.01} for q in (1e-6, 4.0))
    >>> found = interacting(level + random.normal(0, 0.1, 40), [still, walking], [[0.95, 0.05], [0.05, 0.95]], x0=0, P0=1)
    >>> found.models[[15, 35], 1].round(1).tolist()
    [0.0, 1.0]
    """
    rows, state, between = _samples(z), _vector("x0", x0), _model_checks.numbers("`switching`", switching)
    n, m, count = state.size, rows.shape[1], len(models)
    if between.shape != (count, count) or (between < 0).any() or not np.allclose(between.sum(axis=1), 1):
        raise ValueError(f"`switching` has the shape {between.shape}; expected ({count}, {count}), probabilities with the sum 1 in each row")
    first = np.full(count, 1 / count) if chances is None else _vector("chances", chances)
    if first.shape != (count,) or (first < 0).any() or not np.isclose(first.sum(), 1):
        raise ValueError(f"`chances` has the shape {first.shape}; expected ({count},), probabilities with the sum 1")
    inputs, before = None if u is None else _rows("u", u), _matrix("P0", P0, n, n)
    each = []
    for model in models:
        shapes = {"F": (n, n), "H": (m, n), "Q": (n, n), "R": (m, m)}
        parts = {name: _matrix(name, model[name], *shape) for name, shape in shapes.items()}
        _check_numbers(rows, inputs, state, before, parts["Q"], parts["R"])
        if "B" in model and inputs is not None:
            parts["B"] = _matrix("B", model["B"], n, inputs.shape[1])
        each.append(parts)
    found, probabilities = _sampled.by_interacting_models(each, between, first, (rows, state, before, inputs), _lag(smooth))
    return _filtered({**found, "models": probabilities}, None)


def posterior(
    z: ArrayLike,
    F: ArrayLike,
    H: ArrayLike,
    Q: ArrayLike,
    R: ArrayLike,
    x0: ArrayLike,
    P0: ArrayLike,
    *,
    B: ArrayLike | None = None,
    u: ArrayLike | None = None,
    draws: int = 100,
    seed: int = 0,
) -> Numbers:
    """Whole ways of the state of a linear system, drawn from what all samples tell of it (Carter and Kohn 1994).

    What depends on several samples, such as a maximum or the time of a crossing, has the distribution of these ways; means and covariances alone do not
    give it. Rows of `nan` at the end of `z` are simulated onwards.

    Parameters
    ----------
    z, F, H, Q, R, x0, P0, B, u
        As of `kalman`.
    draws : int
        How many.
    seed : int
        Of the random numbers.

    Returns
    -------
    array of the shape (draws, N, n)

    Examples
    --------
    >>> ways = posterior([0.0, np.nan, np.nan, 1.0], F=1, H=1, Q=1, R=1e-9, x0=0, P0=1, draws=20_000)
    >>> ways.mean(axis=0)[1:, 0].round(1).tolist()
    [0.3, 0.7, 1.0]
    """
    filtered = kalman(z, F, H, Q, R, x0, P0, B=B, u=u)
    n = filtered.x.shape[1]
    inputs = None if u is None else _rows("u", u)
    driven = None
    if inputs is not None and B is not None:
        gain = _matrix("B", B, n, inputs.shape[1])
        driven = np.einsum("kij,kj->ki", gain, inputs) if gain.ndim == 3 else inputs @ gain.T
    return _sampled.by_backward_draws(filtered, _matrix("F", F, n, n), _matrix("Q", Q, n, n), driven, draws, seed)


def fit(
    model: Callable[..., Mapping[str, Any]],
    start: Mapping[str, float],
    z: ArrayLike,
    u: ArrayLike | None = None,
    *,
    positive: Collection[str] = (),
) -> Fit:
    """Numbers of a model by maximum likelihood, with standard deviations and intervals; needs SciPy (`kalmems[fit]`).

    Parameters
    ----------
    model : function
        Called with the numbers by their names; gives what `kalman` takes besides samples and inputs, such as `{"F": …, "Q": q, …}`, or of a model of
        functions what `Ekf` takes (`f`, `h`, `Q`, `R` and others) with `x0` and `P0`.
    start : mapping
        The numbers that are sought, and where the search begins.
    z, u : arrays
        Samples and inputs, as of `kalman`.
    positive : names
        Numbers that cannot be 0 or below, such as variances: their logarithms are searched.

    Returns
    -------
    Fit

    Examples
    --------
    The variances of a level that walks at random and is measured:

    >>> random = np.random.default_rng(1)
    >>> z = np.cumsum(random.normal(0, 0.1, 2000)) + random.normal(0, 0.5, 2000)
    >>> found = fit(lambda q, r: dict(F=1, H=1, Q=q, R=r, x0=0, P0=10), {"q": 1, "r": 1}, z, positive=("q", "r"))
    >>> found.converged, [bool(abs(found.values[name] - true) < 3 * found.sd[name]) for name, true in (("q", 0.01), ("r", 0.25))]
    (True, [True, True])
    """
    return _fit.maximised(likelihood(model, start, z, u, positive=positive), start, positive)


def likelihood(
    model: Callable[..., Mapping[str, Any]],
    start: Mapping[str, float],
    z: ArrayLike,
    u: ArrayLike | None = None,
    *,
    positive: Collection[str] = (),
) -> Likelihood:
    """ln p(z) of a model as a function of an array of its numbers, with its gradient: for optimisers and samplers of other libraries.

    Parameters
    ----------
    model, start, z, u, positive
        As of `fit`. The function takes the numbers in the order of `start`, and of those in `positive` the logarithms.

    Returns
    -------
    Likelihood

    Examples
    --------
    >>> of = likelihood(lambda q, r: dict(F=1, H=1, Q=q, R=r, x0=0, P0=1), {"q": 1, "r": 1}, [0.0, 1.0, 2.0], positive=("q", "r"))
    >>> round(of(np.log([1, 1])), 4), of.gradient(np.log([1, 1])).round(4).tolist()
    (-4.6162, [-0.0888, -0.574])
    """
    _fit.check_start(start, positive)
    names = list(start)

    def named(numbers: Numbers) -> dict[str, float]:
        with np.errstate(over="ignore"):
            return {name: float(np.exp(x)) if name in positive else float(x) for name, x in zip(names, numbers, strict=True)}

    def value(numbers: Numbers) -> float:
        try:
            found = _run(dict(model(**named(numbers))), z, u)
        except ArithmeticError:
            # A filter that stops, with numbers that nothing can have.
            return -np.inf
        return float(np.nansum(found.log_likelihood))

    # Once with the checks, so that a model that cannot be meant is refused with its reason.
    _run({**dict(model(**start)), "check": True}, z, u)
    scales, parts = _fit.scales_of(start, positive), dict(model(**start))
    rows, inputs = _samples(z), None if u is None else _rows("u", u)
    m = rows.shape[1]

    def of_functions(numbers: Numbers) -> Numbers:
        found = _run(dict(model(**named(numbers))), rows, inputs)
        here, *moved = (_arrays(model(**named(at)), m) for at in [numbers, *_fit.around(numbers, scales)])
        each = zip(moved[::2], moved[1::2], _fit.steps_of(numbers, scales), strict=True)
        return _sensitivities.slope(found, rows, inputs, here, [_sensitivities.Along(*one) for one in each])

    def matrices(numbers: Numbers) -> dict[str, Numbers]:
        return _matrices(model(**named(numbers)), m, inputs)

    def of_matrices(numbers: Numbers) -> Numbers:
        found = _run({**model(**named(numbers)), "smooth": True}, rows, inputs)
        return _fit.along(matrices, _scores.scores(found, rows, matrices(numbers), inputs), numbers, scales)

    if "f" in parts:
        return Likelihood(value, scales, of_functions if _sensitivities.is_followed(parts, _is_compiled) else None)
    return Likelihood(value, scales, of_matrices if parts.get("degrees_of_freedom") is None else None)


def _arrays(parts: Mapping[str, Any], m: int) -> dict[str, Any]:
    """A model of functions, its arrays in their shapes."""
    state = _vector("x0", parts["x0"])
    shapes = {"Q": state.size, "R": m, "P0": state.size}
    return {**parts, "x0": state, **{name: _matrix(name, parts[name], size, size) for name, size in shapes.items()}}


def _matrices(parts: Mapping[str, Any], m: int, inputs: Numbers | None) -> dict[str, Numbers]:
    """The arrays of a linear system in their shapes."""
    state = _vector("x0", parts["x0"])
    n = state.size
    shapes = {"F": (n, n), "H": (m, n), "Q": (n, n), "R": (m, m), "P0": (n, n)}
    if inputs is not None and parts.get("B") is not None:
        shapes["B"] = (n, inputs.shape[1])
    return {"x0": state, **{name: _matrix(name, parts[name], *shape) for name, shape in shapes.items()}}


def _run(parts: dict[str, Any], z: ArrayLike, u: ArrayLike | None) -> Filtered:
    parts.setdefault("check", False)
    if "f" not in parts:
        return kalman(z, u=u, **parts)
    x0, p0, kind = parts.pop("x0"), parts.pop("P0"), parts.pop("filter", Ekf)
    found: Filtered = kind(**parts).run(z, x0, p0, u)
    return found


def consistency(
    model: Mapping[str, Any],
    samples: int,
    runs: int = 100,
    *,
    u: ArrayLike | None = None,
    truth: Mapping[str, Any] | None = None,
    seed: int = 0,
) -> Consistency:
    """Whether the claims of a filter hold on samples that are simulated from its model, or from another one that is true.

    Parameters
    ----------
    model : mapping
        What `kalman` takes besides samples and inputs, such as `{"F": …, "Q": …, …}`, or of a model of functions what `Ekf` takes (`f`, `h`, `Q`, `R`
        and others) with `x0` and `P0`. `"filter": Ukf` chooses another filter of functions.
    samples, runs : int
        Samples of a run, and runs.
    u : array of the shape (samples, k), optional
        Inputs.
    truth : mapping, optional
        The parts that are different in truth, such as `{"R": …}`.
    seed : int
        Of the random numbers.

    Returns
    -------
    Consistency

    Examples
    --------
    A filter that is told a tenth of the noise of its samples:

    >>> walk = {"F": 1, "H": 1, "Q": 0.01, "R": 1, "x0": 0, "P0": 1}
    >>> consistency(walk, 200).holds, consistency({**walk, "R": 0.1}, 200, truth={"R": 1}).holds
    (True, False)
    """
    if runs < 2 or samples < 1:
        raise ValueError(f"`runs` is {runs} and `samples` {samples}; expected 2 runs or more of 1 sample or more")
    real = {**model, **(truth or {})}
    start = _vector("x0", real["x0"])
    inputs = None if u is None else _rows("u", u)
    n = start.size
    if "f" in real:
        given = {name: real[name] for name in ("f", "h")}
        move, see = (_of_functions(name, function, inputs) for name, function in given.items())
        m = np.atleast_1d(np.asarray(see(start, 0))).size
    else:
        motion, sensor = _matrix("F", real["F"], n, n), np.asarray(real["H"], dtype=np.float64)
        m = sensor.shape[-2] if sensor.ndim > 1 else sensor.size // n
        sensor = _matrix("H", real["H"], m, n)
        gain = None if inputs is None or "B" not in real else _matrix("B", real["B"], n, inputs.shape[1])
        move, see = _of_matrices(motion, gain, inputs), _of_matrices(sensor, None, None)
    parts = {"x0": start, "P0": _matrix("P0", real["P0"], n, n), "Q": _matrix("Q", real["Q"], n, n), "R": _matrix("R", real["R"], m, m)}
    random, found = np.random.default_rng(seed), []
    for _ in range(runs):
        states, z = _consistency.simulated(random, parts, samples, move, see)
        found.append(_consistency.scored(_run(dict(model), z, u), states))
    return _consistency.of_runs(found)


def _of_matrices(matrix: Numbers, gain: Numbers | None, inputs: Numbers | None) -> Callable[[Numbers, int], Numbers]:
    def value(x: Numbers, sample: int) -> Numbers:
        driven = 0.0 if gain is None or inputs is None else _consistency.of_sample(gain, sample) @ inputs[sample]
        return np.asarray(_consistency.of_sample(matrix, sample) @ x + driven)

    return value


def _of_functions(name: str, function: Function, inputs: Numbers | None) -> Callable[[Numbers, int], Numbers]:
    if _is_compiled(function):
        raise ValueError(f"`{name}` is compiled; give a function of Python that is the same for the simulation")

    def value(x: Numbers, sample: int) -> Numbers:
        given = function(x) if inputs is None else function(x, inputs[sample])
        return np.atleast_1d(_model_checks.numbers(f"what `{name}` gives", given))

    return value


def em(
    z: ArrayLike,
    F: ArrayLike,
    H: ArrayLike,
    Q: ArrayLike,
    R: ArrayLike,
    x0: ArrayLike,
    P0: ArrayLike,
    *,
    B: ArrayLike | None = None,
    u: ArrayLike | None = None,
    learn: Collection[str] = ("Q", "R"),
    diagonal: bool = False,
    tolerance: float = 1e-6,
    iterations: int = 1000,
) -> Learned:
    """Q, R and x0 of a linear system by expectation maximisation (Shumway and Stoffer 1982), from the given ones on.

    Each iteration smooths the samples and takes the covariances that the smoothed state gives the noises. It needs no derivatives and never leads
    downhill, and takes many iterations where a noise is small; `fit` gives standard deviations as well.

    Parameters
    ----------
    z, F, H, Q, R, x0, P0, B, u
        As of `kalman`, none of them for each sample.
    learn : names
        Which of `"Q"`, `"R"` and `"x0"` are learned.
    diagonal : bool
        Whether the covariances that are learned stay diagonal.
    tolerance : float
        The search has converged once an iteration adds less to ln p(z).
    iterations : int
        The most iterations.

    Returns
    -------
    Learned

    Examples
    --------
    >>> random = np.random.default_rng(1)
    >>> z = np.cumsum(random.normal(0, 0.1, 2000)) + random.normal(0, 0.5, 2000)
    >>> found = em(z, F=1, H=1, Q=1, R=1, x0=0, P0=10)
    >>> found.converged, found.Q.round(3).item(), found.R.round(2).item()
    (True, 0.009, 0.25)
    """
    others = set(learn) - {"Q", "R", "x0"}
    if others or not learn:
        raise ValueError(f"`learn` has {', '.join(sorted(others)) or 'nothing'}; expected some of Q, R, x0")
    rows, state = _samples(z), _vector("x0", x0)
    n, m = state.size, rows.shape[1]
    motion, sensor, before = _matrix("F", F, n, n), _matrix("H", H, m, n), _matrix("P0", P0, n, n)
    noise, of_samples = _matrix("Q", Q, n, n), _matrix("R", R, m, m)
    each = {"F": motion, "H": sensor, "Q": noise, "R": of_samples}
    if any(matrix.ndim > 2 for matrix in each.values()):
        raise ValueError("a matrix for each sample cannot be learned; give one for all")
    inputs = None if u is None else _rows("u", u)
    driven = None if inputs is None or B is None else inputs @ _matrix("B", B, n, inputs.shape[1]).T
    likelihoods: list[float] = []
    converged, check = False, True
    while True:
        found = kalman(rows, motion, sensor, noise, of_samples, state, before, B=B, u=u, smooth=True, check=check)
        check = False
        likelihoods.append(float(np.nansum(found.log_likelihood)))
        converged = len(likelihoods) > 1 and likelihoods[-1] - likelihoods[-2] < tolerance
        if converged or len(likelihoods) > iterations or len(rows) < 2:
            break
        x, p, crossed = _fit.moments(found, motion, noise)
        if "Q" in learn:
            noise = _fit.step_covariance(x, p, crossed, motion, driven)
        if "R" in learn:
            of_samples = _fit.sample_covariance(rows, x, p, sensor, of_samples)
        if "x0" in learn:
            state = np.ascontiguousarray(x[0])
        if diagonal:
            noise, of_samples = np.diag(np.diag(noise)), np.diag(np.diag(of_samples))
    return Learned(motion, sensor, noise, of_samples, state, np.array(likelihoods), converged)


def _is_compiled(function: Function) -> bool:
    return hasattr(function, "address") or hasattr(function, "argtypes")


def _handed_over(name: str, function: Function) -> tuple[int | None, Function | None]:
    if not _is_compiled(function):
        return None, function
    # A function of Numba has one of ctypes; any other address does not say which arguments are read there.
    compiled: Any = getattr(function, "ctypes", function)
    arguments = getattr(compiled, "argtypes", None)
    if arguments is None:
        raise TypeError(f"`{name}` has an address and does not declare its arguments; expected {_SIGNATURE}")
    if list(arguments) != 3 * [ctypes.POINTER(ctypes.c_double)] or compiled.restype is not None:
        result = "void" if compiled.restype is None else compiled.restype.__name__
        found = f"{result}({', '.join(argument.__name__ for argument in arguments)})"
        raise TypeError(f"`{name}` is compiled as {found}; expected {_SIGNATURE}")
    return ctypes.cast(compiled, ctypes.c_void_p).value, None


def _samples(values: ArrayLike) -> Numbers:
    rows = _rows("z", values)
    if rows.shape[0] < rows.shape[1] and rows.shape[1] > _MEASUREMENTS:
        raise ValueError(f"`z` has the shape {rows.shape}; a row is a sample and a column a measurement: give `z.T`")
    return rows


def _rows(name: str, values: ArrayLike) -> Numbers:
    if isinstance(values, np.ma.MaskedArray):
        array = np.where(np.ma.getmaskarray(values), np.nan, _model_checks.numbers(f"`{name}`", values.data))
    else:
        array = np.ascontiguousarray(_model_checks.numbers(f"`{name}`", values))
    if array.ndim == 1:
        array = array.reshape(-1, 1)
    if array.ndim != 2:
        raise ValueError(f"`{name}` has {array.ndim} axes; expected a row for each sample")
    return array


def _vector(name: str, values: ArrayLike) -> Numbers:
    array = np.atleast_1d(_model_checks.numbers(f"`{name}`", values))
    if array.ndim != 1:
        raise ValueError(f"`{name}` has the shape {array.shape}; expected a number for each state, of the shape ({array.size},)")
    return np.ascontiguousarray(array)


def _matrix(name: str, values: ArrayLike, rows: int, columns: int | None) -> Numbers:
    """A matrix; a vector is the diagonal of a square one, or the only row or column."""
    array = _model_checks.numbers(f"`{name}`", values)
    if array.ndim == 0 and rows == 1:
        array = array.reshape(1, 1)
    if array.ndim == 1 and rows == columns == array.size:
        array = np.diag(array)
    elif array.ndim == 1 and (rows == 1 or columns in (None, 1)) and array.size == rows * (columns or 1):
        array = array.reshape(rows, columns or 1)
    return np.ascontiguousarray(array)
