"""What is refused of the model of a filter before it runs."""

from __future__ import annotations

import ctypes
import inspect
from collections.abc import Callable
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

Numbers: TypeAlias = NDArray[np.float64]
Evaluated: TypeAlias = Callable[[Numbers], Numbers]

SYMMETRY = 1e-12
"""How far a covariance may differ from its transpose, relative to its largest element."""
DERIVATIVE = 1e-2
"""How far an element of a derivative may be from the difference quotient, relative to the larger."""
ROOM = 64
"""Numbers that a compiled function may write too many in a check, where the filter has no room for them."""
BLOCK = 2**16
"""So many samples are looked at in one go."""
TINY = float(np.finfo(float).tiny)
"""The smallest number that has all its digits."""
NEGLIGIBLE = 1e-8
"""The effect of an element on a value, relative to the largest in its row, from which on it is compared."""


def finite(**arrays: Numbers | None) -> None:
    """Refuses numbers that are not finite."""
    for name, array in arrays.items():
        if array is not None and not np.isfinite(array).all():
            raise ValueError(f"`{name}` has elements that are not finite")


def measured(z: Numbers) -> None:
    """Refuses infinite samples; one that is not a number is missing."""
    # In pieces, between which an interruption is heard.
    for start in range(0, len(z), BLOCK):
        places = np.argwhere(np.isinf(z[start : start + BLOCK]))
        if places.size:
            raise ValueError(f"`z` is infinite at sample {start + places[0, 0]}; a sample that is missing is `nan`")


def covariance(name: str, matrix: Numbers) -> None:
    """Refuses what is no covariance, of one or of each sample. One of another shape is refused where the filter begins."""
    if matrix.ndim not in (2, 3) or matrix.shape[-2] != matrix.shape[-1] or matrix.size == 0:
        return
    n, all_of = matrix.shape[-1], matrix.reshape(-1, *matrix.shape[-2:])
    # In pieces, between which an interruption is heard.
    for start in range(0, len(all_of), BLOCK):
        each = all_of[start : start + BLOCK]
        largest = np.abs(each).max(axis=(1, 2))
        difference = np.abs(each - each.transpose(0, 2, 1))
        if (difference > SYMMETRY * largest[:, None, None]).any():
            k, i, j = np.unravel_index(int((difference / np.maximum(largest, TINY)[:, None, None]).argmax()), difference.shape)
            which = "" if matrix.ndim == 2 else f" at sample {start + k}"
            pair = f"element ({i}, {j}) is {each[k, i, j]:g} and ({j}, {i}) is {each[k, j, i]:g}"
            raise ValueError(f"`{name}` is not symmetric{which}: {pair}; give `({name} + {name}.T) / 2` if that is what is meant")
        smallest = np.linalg.eigvalsh(each)[:, 0]
        wrong = smallest < -SYMMETRY * largest * n
        if wrong.any():
            first = int(wrong.argmax())
            which = "" if matrix.ndim == 2 else f" at sample {start + first}"
            mend = "variances are on its diagonal and not negative"
            raise ValueError(f"`{name}` is no covariance{which}: its smallest eigenvalue is {smallest[first]:.3g}; {mend}")


def arguments(name: str, function: Callable[..., Any], has_inputs: bool) -> None:
    """Refuses a function of Python that cannot be called with a state, or a state and inputs."""
    try:
        signature = inspect.signature(function)
    except (TypeError, ValueError):
        # Not all functions that are written in C have one.
        return
    try:
        signature.bind(*(2 if has_inputs else 1) * [None])
    except TypeError:
        mend = f"write `{name}(x, u)`" if has_inputs else f"write `{name}(x)`, or give the inputs `u`"
        given = "with" if has_inputs else "without"
        raise ValueError(f"`{name}{signature}` cannot be called {given} inputs; {mend}") from None


def numbers(what: str, values: Any) -> Numbers:
    """An array of numbers."""
    try:
        return np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError, RuntimeError) as error:
        # A tensor of PyTorch that carries a gradient raises the last one.
        raise ValueError(f"{what} cannot be read as numbers: {error}; give an array or lists of one length") from None


def function(name: str, given: Any) -> None:
    """Refuses what cannot be called."""
    if not callable(given) and not hasattr(given, "address"):
        mend = "give a function of the state, such as `lambda x: matrix @ x`, or use `kalman` for a linear system"
        raise TypeError(f"`{name}` is of the type {type(given).__name__}; {mend}")


def evaluated(name: str, function: Callable[..., Any], inputs: Numbers | None, count: int, is_compiled: bool) -> Evaluated:
    """A function of the state alone, at the inputs of the first sample. One that is compiled fills `count` numbers and no more."""
    if not is_compiled:
        return lambda x: numbers(f"what `{name}` gives", function(x) if inputs is None else function(x, inputs))
    native: Any = getattr(function, "ctypes", function)
    pointer = ctypes.POINTER(ctypes.c_double)

    def call(x: Numbers) -> Numbers:
        state, u, out = x.copy(), np.zeros(1) if inputs is None else inputs.copy(), np.full(count + ROOM, np.nan)
        native(*(array.ctypes.data_as(pointer) for array in (state, u, out)))
        written = count + int(np.count_nonzero(~np.isnan(out[count:])))
        if written > count:
            raise ValueError(f"`{name}` writes {written} numbers; expected {count}, as the state and `z` have it")
        return out[:count]

    return call


def value(name: str, found: Numbers, count: int) -> Numbers:
    """The value of `f` or `h`: a vector, or a number if there is one."""
    if found.shape == (count,) or (count == 1 and found.size == 1):
        return found.reshape(count)
    raise ValueError(f"`{name}` gives an array of the shape {found.shape}; expected ({count},)")


def slope(name: str, found: Numbers, rows: int, columns: int, is_compiled: bool) -> Numbers:
    """The value of `F` or `H`: a matrix, or a vector if it has a single row or column."""
    is_flat = found.ndim < 2 and (is_compiled or min(rows, columns) == 1) and found.size == rows * columns
    if found.shape == (rows, columns) or is_flat:
        return found.reshape(rows, columns)
    raise ValueError(f"`{name}` gives an array of the shape {found.shape}; expected ({rows}, {columns})")


def derivative(name: str, of: str, given: Numbers, function: Evaluated, x: Numbers, scales: Numbers) -> None:
    """Compares a derivative with central differences at a state; `scales` is how far each state is expected to be off."""
    near, _ = differences(function, x, scales, 1.0)
    far, noise = differences(function, x, scales, 2.0)
    # How much of a difference quotient its step and the digits of the values leave undecided.
    unsure = 10 * np.abs(near - far) + 10 * noise
    error, larger = np.abs(given - near), np.maximum(np.abs(given), np.abs(near))
    weights = (larger * scales) / np.maximum((larger * scales).max(axis=1, keepdims=True), TINY)
    wrong = (error > DERIVATIVE * larger + unsure) & (weights > NEGLIGIBLE) | ~np.isfinite(given)
    if wrong.any():
        i, j = np.argwhere(wrong)[0]
        mend = f"correct it, or leave `{name}` out and differences are used (`check=False` leaves all checks out)"
        raise ValueError(f"`{name}` is not the derivative of `{of}` at `x0`: element ({i}, {j}) is {given[i, j]:.6g}, by differences {near[i, j]:.6g}; {mend}")


def differences(function: Evaluated, x: Numbers, scales: Numbers, steps: float) -> tuple[Numbers, Numbers]:
    """∂f/∂x by central differences, and how much of it may come from the digits of the values."""
    slopes, noises = [], []
    for place, scale in enumerate(scales):
        step = np.zeros_like(x)
        step[place] = steps * np.cbrt(np.finfo(float).eps) * max(abs(x[place]), scale)
        above, below = function(x + step).reshape(-1), function(x - step).reshape(-1)
        width = (x + step)[place] - (x - step)[place]
        slopes.append((above - below) / width)
        noises.append(np.finfo(float).eps * (np.abs(above) + np.abs(below)) / width)
    return np.stack(slopes, axis=1), np.stack(noises, axis=1)
