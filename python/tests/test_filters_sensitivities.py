"""The gradient of the likelihood of a model of functions, against complex steps through the equations of its filter written out."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from test_filters_equations import TEXT

from kalmems import filters

Model = Callable[[np.ndarray], dict[str, Any]]
STEP = 0.1
NAMES = ("w", "b", "g", "c", "q", "r", "x", "p")
AT = np.array([2.0, 0.3, 0.5, 1.5, 0.02, 0.1, 0.4, 0.2])


def pendulum(theta: np.ndarray, steps: np.ndarray | None = None) -> dict[str, Any]:
    """A driven pendulum of two sensors, with a number in each of its parts; noises for each sample if `steps` are given."""
    w, b, g, c, q, r, x, p = theta
    each = np.ones((1, 1, 1)) if steps is None else steps[:, None, None]
    noise, of_samples = each * q * np.array([[0.1, 0.02], [0.02, 1]]), each * r * np.array([[1, 0.3], [0.3, 2]])
    return {
        "f": lambda s, u: np.array([s[0] + STEP * s[1], s[1] - STEP * (w * np.sin(s[0]) + b * s[1]) + g * u[0]]),
        "F": lambda s, u: np.array([[1, STEP], [-STEP * w * np.cos(s[0]), 1 - STEP * b]]),
        "h": lambda s, u: np.array([c * np.sin(s[0]), s[0] * s[1] + 0.1 * c * u[0]]),
        "H": lambda s, u: np.array([[c * np.cos(s[0]), 0], [s[1], s[0]]]),
        "Q": noise[0] if steps is None else noise,
        "R": of_samples[0] if steps is None else of_samples,
        "x0": [x, 0.1],
        "P0": [[p, 0.1 * p], [0.1 * p, 1]],
    }


def by_complex_steps(model: Model, at: np.ndarray, z: np.ndarray, u: np.ndarray, largest: float = np.inf) -> np.ndarray:
    """The derivatives of ln p by each number, exact to rounding."""

    def of(array: np.ndarray, sample: int) -> np.ndarray:
        return array[sample] if array.ndim == 3 else array

    found = []
    for place in range(at.size):
        theta = at.astype(complex)
        theta[place] += 1e-30j
        parts = model(theta)
        q, r, x, p = (np.array(parts[name], dtype=complex) for name in ("Q", "R", "x0", "P0"))
        total = 0.0 + 0.0j
        for k, row in enumerate(z):
            if k > 0:
                motion = parts["F"](x, u[k - 1])
                x, p = parts["f"](x, u[k - 1]), motion @ p @ motion.T + of(q, k - 1)
            there = ~np.isnan(row)
            if there.any():
                sensor, left = parts["H"](x, u[k])[there], (row - parts["h"](x, u[k]))[there]
                s = sensor @ p @ sensor.T + of(r, k)[np.ix_(there, there)]
                nis = left @ np.linalg.solve(s, left)
                total -= 0.5 * (nis + np.log(np.linalg.det(2 * np.pi * s)))
                if nis.real <= largest:
                    gain = p @ sensor.T @ np.linalg.inv(s)
                    x, p = x + gain @ left, p - gain @ s @ gain.T
        found.append(total.imag / 1e-30)
    return np.array(found)


def measured(count: int) -> tuple[np.ndarray, np.ndarray]:
    random = np.random.default_rng(8)
    parts, u, x, z = pendulum(AT), random.normal(0, 0.5, (count, 1)), np.array([0.4, 0.1]), []
    for k in range(count):
        z.append(parts["h"](x, u[k]) + random.multivariate_normal([0, 0], parts["R"]))
        x = parts["f"](x, u[k]) + random.multivariate_normal([0, 0], parts["Q"])
    return np.array(z), u


@pytest.mark.parametrize("case", ["complete", "missing", "rejected", "noises of each sample", "square root"])
def test_the_gradient_of_a_model_with_derivatives_is_exact(case: str) -> None:
    z, u = measured(60)
    limits: dict[str, Any] = {"square_root": True} if case == "square root" else {}
    steps = np.linspace(0.5, 2, 60) if case == "noises of each sample" else None
    if case == "missing":
        z[np.random.default_rng(1).uniform(size=z.shape) < 0.3] = np.nan
        z[9] = np.nan
    if case == "rejected":
        z[20, 0], limits = 40.0, {"largest_nis": 30.0}

    def model(**numbers: float) -> dict[str, Any]:
        return {**pendulum(np.array(list(numbers.values())), steps), **limits}

    of = filters.likelihood(model, dict(zip(NAMES, AT, strict=True)), z, u, positive=("q", "r"))
    expected = by_complex_steps(lambda theta: pendulum(theta, steps), AT, z, u, limits.get("largest_nis", np.inf))
    # Of the logarithms of q and r.
    expected[4:6] *= AT[4:6]
    searched = np.where([name in "qr" for name in NAMES], np.log(AT), AT)
    assert np.allclose(of.gradient(searched), expected, rtol=1e-7, atol=1e-8 * np.abs(expected).max())


def test_the_gradient_of_functions_that_are_linear_is_that_of_their_matrices() -> None:
    z = np.cumsum(np.random.default_rng(2).normal(0, 1, 200))

    def matrices(a: float, q: float) -> dict[str, Any]:
        return {"F": [[1, 1], [0, a]], "H": [[1, 0]], "Q": [0, q], "R": 0.5, "x0": [0, 0], "P0": [1, 1]}

    def functions(a: float, q: float) -> dict[str, Any]:
        motion, sensor = np.array([[1, 1], [0, a]]), np.array([[1.0, 0.0]])
        return {**matrices(a, q), "f": lambda x: motion @ x, "F": lambda x: motion, "h": lambda x: sensor @ x, "H": lambda x: sensor}

    start = {"a": 0.9, "q": 0.2}
    exact, followed = (filters.likelihood(model, start, z).gradient([0.8, 0.3]) for model in (matrices, functions))
    assert np.allclose(followed, exact, rtol=1e-8)


def test_a_model_as_text_has_the_gradient_of_its_equations_in_si() -> None:
    """A mass on a spring of the mass m, stiffness k and damping b, sampled exactly by the exponential of its matrix."""
    linalg = pytest.importorskip("scipy.linalg")
    random = np.random.default_rng(3)
    u = 0.01 * np.sin(0.05 * np.arange(150))[:, None]
    z = random.normal(0, 0.06, (150, 1))
    held = {"Q": np.diag([0, 2e-5]), "R": [[4e-3]], "x0": [1e-4, 0], "P0": [[1e-7, 0], [0, 1e-3]]}

    def in_si(theta: np.ndarray) -> dict[str, Any]:
        m, k, b = theta
        rates = np.array([[0, 1, 0], [-k / m, -b / m, 1 / m], [0, 0, 0]])
        whole = linalg.expm(2e-3 * rates)
        return {
            **held,
            "f": lambda x, u: whole[:2, :2] @ x + whole[:2, 2] * u[0],
            "F": lambda x, u: whole[:2, :2],
            "h": lambda x, u: np.array([2e3 * x[0] + 0.5e6 * x[0] ** 2]),
            "H": lambda x, u: np.array([[2e3 + 1e6 * x[0], 0]]),
        }

    def of_text(m: float, k: float, b: float) -> dict[str, Any]:
        return {**filters.Equations(TEXT, 2e-3, values={"m": m, "k": k, "b": b}).parts([0, 0]), **held}

    at = np.array([0.02, 3.0, 0.1])
    found = filters.likelihood(of_text, dict(zip("mkb", at, strict=True)), z, u).gradient(at)
    assert np.allclose(found, by_complex_steps(in_si, at, z, u), rtol=1e-6)


def test_without_derivatives_the_gradient_is_by_differences() -> None:
    z, u = measured(60)

    def model(w: float, c: float, *, has_derivatives: bool) -> dict[str, Any]:
        theta = AT.copy()
        theta[0], theta[3] = w, c
        parts = pendulum(theta)
        return {name: part for name, part in parts.items() if has_derivatives or name not in "FH"}

    start = {"w": 2.0, "c": 1.5}
    exact, by_differences = (
        filters.likelihood(lambda w, c, has=has: model(w, c, has_derivatives=has), start, z, u).gradient([2.1, 1.4]) for has in (True, False)
    )
    assert np.allclose(by_differences, exact, rtol=1e-5) and not np.array_equal(by_differences, exact)
