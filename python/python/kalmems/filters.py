"""Kalman filters over arrays, for linear systems and for models of one's own.

What is known before, `x0` and `P0`, is of the first sample before it is taken: that is updated with first, and each further sample is predicted
and then updated with. A sample with a value that is not a number is predicted only. Filters are compiled for up to six states and two
measurements.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _kalmems

__all__ = ["Ekf", "Filtered", "Smoothed", "Ukf", "kalman"]

_SIGNATURE = "void(CPointer(float64), CPointer(float64), CPointer(float64))"

Numbers = NDArray[np.float64]
Function: TypeAlias = Callable[..., Any]
"""A function of Python, `f(x)` or with inputs `f(x, u)`, or one compiled by `numba.cfunc`; see `Ekf`."""


@dataclass(frozen=True, eq=False)
class Smoothed:
    """What all samples say of the state at each (Rauch, Tung and Striebel)."""

    x: Numbers
    """The mean of the state: a row for each sample."""
    P: Numbers
    """Its covariance."""

    @property
    def sd(self) -> Numbers:
        """The standard deviations of the state."""
        return np.sqrt(np.diagonal(self.P, axis1=1, axis2=2))

    def __len__(self) -> int:
        return len(self.x)


@dataclass(frozen=True, eq=False)
class Filtered:
    """What a filter says of each sample, after it was taken."""

    x: Numbers
    """The mean of the state: a row for each sample."""
    P: Numbers
    """Its covariance."""
    innovation: Numbers
    """z − h(x⁻); not a number where a sample is missing."""
    S: Numbers
    """The covariance that the filter gives the innovation."""
    nis: Numbers
    """The normalised innovation squared: on average as many as there are measurements, of a filter that is right."""
    log_likelihood: Numbers
    """ln p(z | past) of each sample."""
    smoothed: Smoothed | None = None
    """The state given the later samples as well, where `smooth=True` asked for it."""

    @property
    def sd(self) -> Numbers:
        """The standard deviations of the state."""
        return np.sqrt(np.diagonal(self.P, axis1=1, axis2=2))

    def __len__(self) -> int:
        return len(self.x)


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
    smooth: bool = False,
) -> Filtered:
    """The Kalman filter of x′ = F·x + B·u + w, z = H·x + v with the covariances Q of w and R of v; `u[k]` acts from sample k to k + 1. With
    `smooth` also the smoother over all samples."""
    rows, states = _rows(z), _vector(x0)
    n, m = states.size, rows.shape[1]
    inputs = None if u is None else _rows(u)
    gain = None if B is None else _matrix(B, n, None if inputs is None else inputs.shape[1])
    if (inputs is None) != (gain is None):
        raise ValueError("`B` and `u` belong together")
    matrices = (_matrix(F, n, n), _matrix(H, m, n), _matrix(Q, n, n), _matrix(R, m, m))
    return _filtered(_kalmems.kalman(rows, *matrices, states, _matrix(P0, n, n), gain, inputs, smooth))


def _filtered(found: dict[str, Numbers]) -> Filtered:
    x, covariance = found.pop("smoothed_x", None), found.pop("smoothed_P", None)
    smoothed = None if x is None or covariance is None else Smoothed(x, covariance)
    return Filtered(**found, smoothed=smoothed)


class _Nonlinear:
    _points: tuple[float, float, float] | None = None

    def __init__(
        self,
        f: Function,
        h: Function,
        *,
        Q: ArrayLike,
        R: ArrayLike,
        F: Function | None = None,
        H: Function | None = None,
    ) -> None:
        self._functions = [f, F, h, H]
        self._q, self._r = Q, R

    def run(
        self, z: ArrayLike, x0: ArrayLike, P0: ArrayLike, u: ArrayLike | None = None, *, smooth: bool = False
    ) -> Filtered:
        """Takes the samples `z`, a row each, with the inputs `u`; `u[k]` acts from sample k to k + 1, and `h` sees it at k. With `smooth` also
        the smoother over all samples."""
        rows, states = _rows(z), _vector(x0)
        n, m = states.size, rows.shape[1]
        compiled = [_is_compiled(function) for function in self._functions if function is not None]
        if any(compiled) != all(compiled):
            raise ValueError("some functions of the model are compiled and some are not; give all of one kind")
        functions = [
            None if function is None else _handed_over(name, function)
            for name, function in zip(("f", "F", "h", "H"), self._functions, strict=True)
        ]
        inputs = None if u is None else _rows(u)
        noise = (_matrix(self._q, n, n), _matrix(self._r, m, m))
        return _filtered(
            _kalmems.nonlinear(rows, functions, *noise, states, _matrix(P0, n, n), inputs, self._points, smooth)
        )


class Ekf(_Nonlinear):
    """The extended Kalman filter of x′ = f(x, u) + w, z = h(x, u) + v.

    `F` and `H` are the derivatives ∂f/∂x and ∂h/∂x, as matrices; where they are left out, central differences take their place.

    Functions of Python get arrays, `f(x)` or, with inputs, `f(x, u)`, and give one. At native speed run functions that
    `numba.cfunc("void(CPointer(float64), CPointer(float64), CPointer(float64))")` compiles: `f(x, u, out)`, all as pointers, with matrices row
    after row in `out`. A function of `ctypes` with `argtypes` of three `POINTER(c_double)` and the `restype` `None` is taken as well.
    """


class Ukf(_Nonlinear):
    """The unscented Kalman filter of the same models, by sigma points with the spread α, β, κ and without derivatives."""

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
    ) -> None:
        super().__init__(f, h, Q=Q, R=R)
        self._points = (alpha, beta, kappa)


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


def _rows(values: ArrayLike) -> Numbers:
    masked = np.ma.filled(np.ma.asarray(values, dtype=np.float64), np.nan)
    array = np.ascontiguousarray(masked, dtype=np.float64)
    if array.ndim == 1:
        array = array.reshape(-1, 1)
    if array.ndim != 2:
        raise ValueError(f"found {array.ndim} axes; expected a row for each sample")
    return array


def _vector(values: ArrayLike) -> Numbers:
    return np.ascontiguousarray(np.atleast_1d(np.asarray(values, dtype=np.float64))).reshape(-1)


def _matrix(values: ArrayLike, rows: int, columns: int | None) -> Numbers:
    array = np.asarray(values, dtype=np.float64)
    if array.ndim == 0 and rows == 1:
        array = array.reshape(1, 1)
    if array.ndim == 1 and rows == columns == array.size:
        array = np.diag(array)
    elif array.ndim == 1 and array.size == rows * (columns or 1):
        array = array.reshape(rows, columns or 1)
    return np.ascontiguousarray(array)
