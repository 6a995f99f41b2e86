"""Linear systems of other libraries, sampled systems, and gains that stay as they are."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._consistency import of_sample
from ._model_checks import numbers
from ._needed import needed

Numbers: TypeAlias = NDArray[np.float64]

SETTLED = 1e-14
"""The relative change of a covariance from which on it stays."""
DOUBLINGS = 60
"""2⁶⁰ samples: what has not settled by then does not settle."""


@dataclass(frozen=True, eq=False)
class Steady:
    """What the filter of a linear system with constant matrices settles to."""

    K: Numbers
    """The gain, of the shape (n, m): x⁺ = x⁻ + K·(z − H·x⁻)."""
    P: Numbers
    """The covariance after a sample, of the shape (n, n)."""
    predicted: Numbers
    """The covariance before a sample, of the shape (n, n): a filter that begins with it as `P0` has this gain from the first sample on."""


def settled(F: Numbers, H: Numbers, Q: Numbers, R: Numbers) -> Steady:
    """The solution of the discrete Riccati equation by doubling (Anderson 1978)."""
    n = len(F)
    a, g, p = F.T, H.T @ np.linalg.solve(R, H), Q
    for _ in range(DOUBLINGS):
        with np.errstate(over="ignore", invalid="ignore"):
            inverse = np.linalg.inv(np.eye(n) + g @ p)
            grown = p + a.T @ p @ inverse @ a
            g, a = g + a @ inverse @ g @ a.T, a @ inverse @ a
        if not np.isfinite(grown).all():
            break
        moved, p = np.abs(grown - p).max(), 0.5 * (grown + grown.T)
        if moved <= SETTLED * np.abs(p).max():
            s = H @ p @ H.T + R
            gain = np.linalg.solve(s, H @ p).T
            return Steady(np.asarray(gain, dtype=np.float64), p - gain @ s @ gain.T, p)
    raise ArithmeticError("the covariance does not settle: a state grows that no measurement shows; measure it, or leave it out")


def with_gain(parts: dict[str, Numbers], z: Numbers, gain: Numbers, driven: Numbers | None) -> dict[str, Any]:
    """The filter of a gain that stays as it is, with the covariance that its errors have: (1 − K·H)·P·(1 − K·H)ᵀ + K·R·Kᵀ."""
    x, p, n = parts["x0"], parts["P0"], len(parts["x0"])
    rows, m = len(z), z.shape[1]
    found: dict[str, Any] = {"x": np.empty((rows, n)), "P": np.empty((rows, n, n)), "innovation": np.full((rows, m), np.nan)}
    found |= {"S": np.full((rows, m, m), np.nan), "nis": np.full(rows, np.nan), "log_likelihood": np.full(rows, np.nan)}
    found["taken"] = np.zeros(rows, dtype=bool)
    for k, sample in enumerate(z):
        if k > 0:
            f = of_sample(parts["F"], k - 1)
            x = f @ x + (0.0 if driven is None else driven[k - 1])
            p = f @ p @ f.T + of_sample(parts["Q"], k - 1)
        there = np.flatnonzero(~np.isnan(sample))
        if there.size:
            h, r, own = of_sample(parts["H"], k)[there], of_sample(parts["R"], k)[np.ix_(there, there)], gain[:, there]
            left, s, kept = sample[there] - h @ x, h @ p @ h.T + r, np.eye(n) - own @ h
            x, p = x + own @ left, kept @ p @ kept.T + own @ r @ own.T
            nis = left @ np.linalg.solve(s, left)
            found["innovation"][k, there], found["S"][k][np.ix_(there, there)], found["nis"][k] = left, s, nis
            found["log_likelihood"][k], found["taken"][k] = -0.5 * (nis + np.linalg.slogdet(2 * np.pi * s)[1]), True
        found["x"][k], found["P"][k] = x, p
    return found


def matrices_of(system: Any) -> tuple[Numbers, Numbers, Numbers, float | None]:
    """A, B and C of a state space, and its interval; none of a continuous one."""
    if isinstance(system, (tuple, list)):
        if len(system) not in (3, 4, 5):
            raise ValueError(f"`system` has {len(system)} parts; expected (A, B, C), (A, B, C, D) or (A, B, C, D, interval)")
        parts, interval = system[:4], system[4] if len(system) == 5 else None
    elif all(hasattr(system, name) for name in "ABCD"):
        parts, interval = [getattr(system, name) for name in "ABCD"], getattr(system, "dt", None)
    elif hasattr(system, "to_ss"):
        # A transfer function of SciPy, or its zeros and poles.
        return matrices_of(system.to_ss())
    else:
        kind = type(system).__name__
        raise TypeError(f"`system` is of the type {kind}; expected a state space of SciPy or python-control, or (A, B, C) as arrays")
    a, b, c, *feedthrough = (np.atleast_2d(numbers(f"`{name}` of the system", part)) for name, part in zip("ABCD", parts, strict=False))
    if feedthrough and np.any(feedthrough[0]):
        raise ValueError("the system has a feedthrough `D`; filter `z - u @ D.T` with the system without it")
    if interval is True:
        raise ValueError("the system is sampled at an interval that it does not state; give it one, such as `control.ss(A, B, C, D, 0.01)`")
    return a, b, c, float(interval) if interval else None


def sampled(a: Numbers, b: Numbers, density: Numbers | None, interval: float) -> tuple[Numbers, Numbers, Numbers | None]:
    """F, B and Q over an interval of inputs that are held (Van Loan 1978)."""
    expm = needed("scipy.linalg", "fit").expm
    n, k = b.shape
    whole = expm(interval * np.block([[a, b], [np.zeros((k, n + k))]]))
    if density is None:
        return whole[:n, :n], whole[:n, n:], None
    both = expm(interval * np.block([[-a, density], [np.zeros((n, n)), a.T]]))
    noise = both[n:, n:].T @ both[:n, n:]
    return whole[:n, :n], whole[:n, n:], 0.5 * (noise + noise.T)


def from_state_space(system: Any, *, interval: ArrayLike | None = None, density: ArrayLike | None = None) -> dict[str, Numbers]:
    """The matrices that `kalman` takes, of a state space of SciPy, python-control or arrays; a continuous one is sampled, which needs SciPy.

    Parameters
    ----------
    system : state space
        Of `scipy.signal` or `control`, or (A, B, C), (A, B, C, D) or (A, B, C, D, interval) as arrays. D must be zero.
    interval : float or array of the shape (N - 1,), optional
        Seconds from a sample to the next, for a continuous system; an array gives matrices for each sample.
    density : array of the shape (n, n), optional
        The power density of the noise of ẋ, in the unit of the states squared per second; a vector is its diagonal. With it `Q` is returned.

    Returns
    -------
    dict
        `F`, `B`, `H`, and `Q` if a density is given.

    Examples
    --------
    A mass with a force as its input, sampled every 0.5 s:

    >>> parts = from_state_space(([[0, 1], [0, 0]], [[0], [1]], [[1, 0]]), interval=0.5, density=[0, 0.3])
    >>> parts["F"].tolist(), parts["B"].ravel().tolist(), parts["Q"].round(4).tolist()
    ([[1.0, 0.5], [0.0, 1.0]], [0.125, 0.5], [[0.0125, 0.0375], [0.0375, 0.15]])
    """
    a, b, c, own = matrices_of(system)
    n = len(a)
    noise = None if density is None else numbers("`density`", density)
    noise = np.diag(noise) if noise is not None and noise.ndim == 1 else noise
    if noise is not None and noise.shape != (n, n):
        raise ValueError(f"`density` has the shape {noise.shape}; expected ({n}, {n})")
    if own is not None:
        if interval is not None or noise is not None:
            raise ValueError(f"the system is sampled every {own:g} s already; leave `interval` and `density` out, and give `Q` to the filter")
        return {"F": a, "B": b, "H": c}
    if interval is None:
        raise ValueError("the system is continuous; give the `interval` between samples in s")
    steps = numbers("`interval`", interval)
    if not (steps > 0).all() or steps.ndim > 1:
        raise ValueError("`interval` has steps that are not above 0; give seconds from each sample to the next")
    lengths, which = np.unique(np.append(steps, steps[-1:]) if steps.ndim else steps, return_inverse=True)
    each = [sampled(a, b, noise, float(length)) for length in lengths]
    stacks = {name: [part for part in (one[place] for one in each) if part is not None] for place, name in enumerate(("F", "B", "Q"))}
    found = {name: np.stack(stack) for name, stack in stacks.items() if stack}
    return {**{name: stack[which] if steps.ndim else stack[0] for name, stack in found.items()}, "H": c}


def to_state_space(F: ArrayLike, H: ArrayLike, B: ArrayLike | None = None, *, interval: float, library: str = "scipy") -> Any:
    """A sampled state space of `scipy.signal`, or of python-control with `library="control"`, of the matrices of `kalman`.

    Examples
    --------
    >>> system = to_state_space([[1, 0.5], [0, 1]], [[1, 0]], [[0.125], [0.5]], interval=0.5)
    >>> system.dt, from_state_space(system)["B"].ravel().tolist()
    (0.5, [0.125, 0.5])
    """
    motion, sensor = (np.atleast_2d(numbers(name, matrix)) for name, matrix in (("`F`", F), ("`H`", H)))
    n = len(motion)
    gain = np.zeros((n, 1)) if B is None else numbers("`B`", B).reshape(n, -1)
    straight = np.zeros((len(sensor), gain.shape[1]))
    if library == "scipy":
        return needed("scipy.signal", "fit").StateSpace(motion, gain, sensor, straight, dt=interval)
    if library == "control":
        return needed("control", "control").ss(motion, gain, sensor, straight, interval)
    raise ValueError(f"`library` is {library!r}; expected 'scipy' or 'control'")


def together(*sensors: tuple[ArrayLike, ArrayLike], tolerance: float = 0.0) -> tuple[Numbers, Numbers]:
    """Samples of several sensors in one array of rows, sorted by time, with `nan` for the sensors that have none at a time.

    Each sensor keeps its own rate and times, and samples that came late are put where they were measured.

    Parameters
    ----------
    *sensors : pairs of arrays
        Times in s, of the shape (count,) and in any order, and samples, of the shape (count,) or (count, m).
    tolerance : float
        Times that are at most so far apart, in s, are one row; the first of them is its time.

    Returns
    -------
    times, z
        Of the shapes (N,) and (N, all m).

    Examples
    --------
    >>> times, z = together(([0.0, 0.1, 0.2], [1.0, 1.1, 1.2]), ([0.2, 0.05], [[7.0, 8.0], [5.0, 6.0]]))
    >>> times.tolist()
    [0.0, 0.05, 0.1, 0.2]
    >>> z[1:3].tolist()
    [[nan, 5.0, 6.0], [1.1, nan, nan]]
    """
    pairs = []
    for place, (given, values) in enumerate(sensors):
        times, z = np.atleast_1d(numbers(f"times of sensor {place}", given)), numbers(f"samples of sensor {place}", values)
        z = z.reshape(-1, 1) if z.ndim == 1 else z
        if times.ndim != 1 or z.ndim != 2 or len(z) != len(times) or not np.isfinite(times).all():
            raise ValueError(f"sensor {place} has times of the shape {times.shape} and samples of the shape {z.shape}; expected (count,) and (count, m)")
        pairs.append((times, z))
    if not pairs:
        raise ValueError("there are no sensors; give pairs of times and samples")
    everything = np.unique(np.concatenate([times for times, _ in pairs]))
    rows, begin = [], -np.inf
    for time in everything:
        begin = time if time - begin > tolerance else begin
        rows.append(begin)
    starts = np.unique(rows)
    z = np.full((len(starts), sum(values.shape[1] for _, values in pairs)), np.nan)
    column = 0
    for place, (times, values) in enumerate(pairs):
        row = np.searchsorted(starts, times, side="right") - 1
        if len(np.unique(row)) < len(row):
            raise ValueError(f"sensor {place} has two samples in one row; give a smaller `tolerance`, or the mean of them")
        z[row, column : column + values.shape[1]] = values
        column += values.shape[1]
    return starts, z
