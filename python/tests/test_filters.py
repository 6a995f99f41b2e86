"""Filters over arrays, against the equations written out in NumPy."""

from __future__ import annotations

import ctypes
import doctest
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from kalmems import _equations, _systems, filters

RNG = np.random.default_rng(1)
F = np.array([[1.0, 0.1], [-0.1, 0.98]])
H = np.array([[1.0, 0.0]])
Q = np.diag([1e-4, 1e-3])
R = np.array([[0.04]])
B = np.array([[0.0], [0.1]])
X0, P0 = np.array([1.0, 0.0]), np.eye(2)
U = np.sin(np.arange(400) * 0.1)[:, None]


def measured() -> np.ndarray:
    x, rows = X0.copy(), []
    for u in U:
        rows.append(H @ x + RNG.normal(0, 0.2, 1))
        x = F @ x + B @ u + RNG.multivariate_normal([0, 0], Q)
    return np.array(rows)


def by_hand(z: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    x, p, means, covariances, likelihood = X0, P0, [], [], 0.0
    for k, y in enumerate(z):
        if k > 0:
            x, p = F @ x + B @ U[k - 1], F @ p @ F.T + Q
        if np.isfinite(y).all():
            s = H @ p @ H.T + R
            gain = p @ H.T @ np.linalg.inv(s)
            residual = y - H @ x
            x, p = x + gain @ residual, (np.eye(2) - gain @ H) @ p
            likelihood -= 0.5 * float(np.log(2 * np.pi * s[0, 0]) + residual[0] ** 2 / s[0, 0])
        means.append(x)
        covariances.append(p)
    return np.array(means), np.array(covariances), likelihood


def test_the_linear_filter_is_that_of_the_equations_with_samples_missing() -> None:
    z = measured()
    z[[7, 100, 101]] = np.nan
    found = filters.kalman(z, F, H, Q, R, X0, P0, B=B, u=U)
    means, covariances, likelihood = by_hand(z)
    assert np.allclose(found.x, means, atol=1e-13) and np.allclose(found.P, covariances, atol=1e-13)
    assert np.isnan(found.nis[7]) and np.nansum(found.log_likelihood) == pytest.approx(likelihood, rel=1e-12)
    assert np.array_equal(found.sd[:, 0], np.sqrt(found.P[:, 0, 0]))
    masked = np.ma.MaskedArray(np.nan_to_num(z), np.isnan(z))
    assert np.array_equal(filters.kalman(masked, F, H, Q, R, X0, P0, B=B, u=U).x, found.x)


def test_the_smoother_is_the_estimate_by_all_samples_at_once() -> None:
    z = measured()[:40]
    z[5] = np.nan
    u = U[:40]
    found = filters.kalman(z, F, H, Q, R, X0, P0, B=B, u=u, smooth=True)
    assert found.smoothed is not None
    # All states as one vector, by the normal equations of what is known of them: a start, steps and samples.
    count = len(z)
    information, vector = np.zeros((2 * count, 2 * count)), np.zeros(2 * count)

    def know(places: list[slice], matrices: list[np.ndarray], value: np.ndarray, covariance: np.ndarray) -> None:
        weight = np.linalg.inv(covariance)
        for one, of_one in zip(places, matrices, strict=True):
            vector[one] += of_one.T @ weight @ value
            for other, of_other in zip(places, matrices, strict=True):
                information[one, other] += of_one.T @ weight @ of_other

    at = [slice(2 * k, 2 * k + 2) for k in range(count)]
    know([at[0]], [np.eye(2)], X0, P0)
    for k in range(count):
        if k > 0:
            know([at[k - 1], at[k]], [-F, np.eye(2)], B @ u[k - 1], Q)
        if np.isfinite(z[k]).all():
            know([at[k]], [H], z[k], R)
    covariance = np.linalg.inv(information)
    assert np.allclose(found.smoothed.x.ravel(), covariance @ vector, atol=1e-9)
    assert np.allclose(found.smoothed.P, [covariance[one, one] for one in at], atol=1e-9)
    assert np.all(found.smoothed.sd <= found.sd + 1e-12)
    model = {"f": lambda x, u: F @ x + B @ u, "h": lambda x, u: H @ x, "Q": Q, "R": R}
    for nonlinear in (filters.Ekf(**model), filters.Ukf(**model)):
        again = nonlinear.run(z, X0, P0, u, smooth=True).smoothed
        assert again is not None and np.allclose(again.x, found.smoothed.x, atol=1e-6)
    assert filters.kalman(z, F, H, Q, R, X0, P0, B=B, u=u).smoothed is None


def test_nonlinear_filters_of_a_linear_model_are_the_linear_filter() -> None:
    z = measured()
    linear = filters.kalman(z, F, H, Q, R, X0, P0, B=B, u=U)
    model = {"f": lambda x, u: F @ x + B @ u, "h": lambda x, u: H @ x, "Q": Q, "R": R}
    exact = filters.Ekf(**model, F=lambda x, u: F, H=lambda x, u: H).run(z, X0, P0, U)
    differences = filters.Ekf(**model).run(z, X0, P0, U)
    unscented = filters.Ukf(**model).run(z, X0, P0, U)
    assert np.allclose(exact.x, linear.x, atol=1e-13)
    assert np.allclose(differences.x, linear.x, atol=1e-8)
    assert np.allclose(unscented.x, linear.x, atol=1e-11)


def test_compiled_functions_give_the_numbers_of_python_functions() -> None:
    numba = pytest.importorskip("numba")
    signature = "void(CPointer(float64), CPointer(float64), CPointer(float64))"

    @numba.cfunc(signature)
    def move(x, u, out):
        out[0] = x[0] + 0.1 * x[1]
        out[1] = x[1] - 0.1 * np.sin(x[0]) + 0.1 * u[0]

    @numba.cfunc(signature)
    def see(x, u, out):
        out[0] = x[0] * x[0]

    z = 1 + 0.1 * RNG.normal(size=300)
    u = np.zeros((300, 1))
    python = {
        "f": lambda x, u: [x[0] + 0.1 * x[1], x[1] - 0.1 * np.sin(x[0]) + 0.1 * u[0]],
        "h": lambda x, u: [x[0] * x[0]],
    }
    for kind in (filters.Ekf, filters.Ukf):
        native = kind(f=move, h=see, Q=Q, R=R).run(z, X0, P0, u)
        assert np.allclose(native.x, kind(**python, Q=Q, R=R).run(z, X0, P0, u).x, atol=1e-9)


def test_compiled_functions_of_another_signature_are_refused() -> None:
    numba = pytest.importorskip("numba")
    pointer = ctypes.POINTER(ctypes.c_double)

    def see(x, u, out) -> None:
        out[0] = x[0]

    def model(h: object, f: object = ctypes.CFUNCTYPE(None, pointer, pointer, pointer)(see)) -> filters.Ekf:
        return filters.Ekf(f, h, Q=[[1e-3]], R=R)

    z, one = np.ones(20), numba.cfunc("void(CPointer(float64), CPointer(float64), CPointer(float64))")(see)
    expected = filters.kalman(z, [[1]], [[1]], [[1e-3]], R, [0], [[1]])
    assert np.allclose(model(one).run(z, [0], [[1]]).x, expected.x, atol=1e-9)

    class Somewhere:
        address = one.address

    for h, found in [
        (numba.cfunc("float64(float64)")(lambda x: x), r"compiled as c_double\(c_double\)"),
        (numba.cfunc("void(CPointer(float32), CPointer(float32), CPointer(float32))")(see), "LP_c_float, "),
        (ctypes.CFUNCTYPE(ctypes.c_double, pointer, pointer, pointer)(lambda x, u, out: 0.0), r"c_double\(LP_c_double, "),
        (ctypes.CDLL(None).cos, "does not declare its arguments"),
        (Somewhere(), "does not declare its arguments"),
    ]:
        with pytest.raises(TypeError, match=rf"`h`.*{found}.*; expected void\(CPointer\(float64\), "):
            model(h).run(z, [0], [[1]])
    with pytest.raises(TypeError, match="`f` is compiled"):
        model(one, numba.cfunc("float64(float64)")(lambda x: x)).run(z, [0], [[1]])


def test_the_examples_of_the_documentation_give_what_they_say() -> None:
    tried = 0
    for module in (filters, _equations, _systems):
        failed, count = doctest.testmod(module)
        assert failed == 0, module
        tried += count
    assert tried >= 60
    for one in (filters.kalman, filters.Ekf, filters.Ukf, filters.Filtered, filters.Smoothed):
        assert ">>> " in (one.__doc__ or "")


def test_filters_and_what_they_give_say_what_they_are() -> None:
    z = measured()
    z[3] = np.nan
    found = filters.kalman(z, F, H, Q, R, X0, P0, smooth=True)
    assert repr(found).startswith("<Filtered: 400 samples of 2 states and 1 measurement, 1 of them without an update, log-likelihood ")
    assert repr(found.smoothed) == "<Smoothed: 400 samples of 2 states>"
    assert repr(filters.Ukf(see, see, Q=Q, R=0.04)) == "Ukf(f=see, h=see, alpha=1, beta=2, kappa=1, Q=[[0.0001, 0.0], [0.0, 0.001]], R=0.04)"


def linear(**other: Any) -> filters.Ekf:
    """The linear model as functions, with other ones in place of some."""
    model = {"f": lambda x: F @ x, "h": lambda x: H @ x, "F": lambda x: F, "H": lambda x: H, "Q": Q, "R": R}
    return filters.Ekf(**{**model, **other})


def off(matrix: np.ndarray, place: tuple[int, int], by: float) -> np.ndarray:
    changed = matrix.astype(float)
    changed[place] += by
    return changed


REFUSED: list[tuple[Callable[[np.ndarray], object], str]] = [
    (lambda z: filters.kalman(z, F, H, Q, R, X0, [[1, 0.5], [0, 1]]), r"`P0` is not symmetric: element \(0, 1\) is 0.5 and \(1, 0\) is 0; give `\(P0 \+ P0.T\) / 2`"),
    (lambda z: filters.kalman(z, F, H, off(Q, (0, 1), 1e-9), R, X0, P0), "`Q` is not symmetric"),
    (lambda z: filters.kalman(z, F, H, [[1, 2], [2, 1]], R, X0, P0), "`Q` is no covariance: its smallest eigenvalue is -1;"),
    (lambda z: filters.kalman(z, F, H, Q, [[-5.0]], X0, P0), "`R` is no covariance: its smallest eigenvalue is -5;"),
    (lambda z: filters.kalman(z, off(F, (0, 0), np.nan), H, Q, R, X0, P0), "`F` has elements that are not finite"),
    (lambda z: filters.kalman(z, F, H, Q, R, [np.inf, 0], P0), "`x0` has elements that are not finite"),
    (lambda z: filters.kalman(np.where(np.arange(len(z)) == 7, np.inf, z[:, 0]), F, H, Q, R, X0, P0), "`z` is infinite at sample 7; a sample that is missing is `nan`"),
    (lambda z: filters.kalman(z, F, H, Q, R, [[1], [0]], P0), r"`x0` has the shape \(2, 1\); expected a number for each state, of the shape \(2,\)"),
    (lambda z: filters.kalman(z, F.ravel(), H, Q, R, X0, P0), r"`F` has the shape \[4\]; expected \[2, 2\] or \[400, 2, 2\]"),
    (lambda z: filters.kalman(z, F, H.T, Q, R, X0, P0), r"`H` has the shape \[2, 1\]; expected \[1, 2\] or \[400, 1, 2\]"),
    (lambda z: linear(H=lambda x: H.T).run(z, X0, P0), r"`H` gives an array of the shape \(2, 1\); expected \(1, 2\)"),
    (lambda z: linear(F=lambda x: F.ravel()).run(z, X0, P0), r"`F` gives an array of the shape \(4,\); expected \(2, 2\)"),
    (lambda z: linear(f=lambda x: [1, 2, 3]).run(z, X0, P0), r"`f` gives an array of the shape \(3,\); expected \(2,\)"),
    (lambda z: linear(f=lambda x: F @ x[:, None]).run(z, X0, P0), r"`f` gives an array of the shape \(2, 1\); expected \(2,\)"),
    (lambda z: linear(F=lambda x: off(F, (1, 0), -5)).run(z, X0, P0), r"`F` is not the derivative of `f` at `x0`: element \(1, 0\) is -5.1, by differences -0.1; correct it, or leave `F` out"),
    (lambda z: linear(F=lambda x: off(F, (0, 1), -0.1)).run(z, X0, P0), r"element \(0, 1\) is 0, by differences 0.1;"),
    (lambda z: linear(H=lambda x: -H).run(z, X0, P0), r"`H` is not the derivative of `h` at `x0`: element \(0, 0\) is -1, by differences 1;"),
    (lambda z: linear(f=lambda x, u: F @ x).run(z, X0, P0), r"`f\(x, u\)` cannot be called without inputs; write `f\(x\)`, or give the inputs `u`"),
    (lambda z: linear().run(z, X0, P0, U), r"`f\(x\)` cannot be called with inputs; write `f\(x, u\)`"),
]


@pytest.mark.parametrize("place", range(len(REFUSED)))
def test_a_model_that_cannot_be_meant_is_refused(place: int) -> None:
    call, mend = REFUSED[place]
    with pytest.raises(ValueError, match=mend):
        call(measured())


def test_models_that_can_be_meant_are_not_refused() -> None:
    z = measured()
    # Rounding, covariances of less than full rank, and derivatives as vectors if they have one row.
    rounded = P0 + np.array([[0, 1e-13], [0, 0]])
    along = np.array([[1.0], [3.0]])
    filters.kalman(z, F, H, along @ along.T / 3, R, X0, rounded)
    linear(H=lambda x: H[0]).run(z, X0, P0)
    # At the middle and far from it, of states with scales that differ by 12 orders of magnitude.
    for start in (np.zeros(2), np.array([1e-7, 3e4])):
        steep = {"f": lambda x: [1e6 + np.sin(x[0]) + 1e-6 * x[1], np.exp(-1e-5 * x[1]) * x[0]], "h": lambda x: [x[0]], "R": R, "Q": Q}
        slope = {"F": lambda x: [[np.cos(x[0]), 1e-6], [np.exp(-1e-5 * x[1]), -1e-5 * np.exp(-1e-5 * x[1]) * x[0]]], "H": lambda x: [1, 0]}
        filters.Ekf(**steep, **slope).run(z[:1], start, np.diag([1e-6, 1e6]))


def test_checks_can_be_left_out_and_are_made_once() -> None:
    z, calls = measured(), []
    wrong = off(F, (1, 0), -5)
    linear(F=lambda x: wrong, check=False).run(z, X0, P0)
    with pytest.raises(ArithmeticError, match="stops at sample 0: the innovation covariance"):
        filters.kalman(z, F, H, Q, [[-5.0]], X0, P0, check=False)

    def derivative(x: np.ndarray) -> np.ndarray:
        calls.append(x)
        return F

    model = linear(F=derivative)
    model.run(z[:1], X0, P0)
    assert len(calls) == 1
    model.run(z[:1], X0, P0)
    assert len(calls) == 1


def test_derivatives_of_compiled_functions_are_compared() -> None:
    signature = ctypes.CFUNCTYPE(None, *3 * [ctypes.POINTER(ctypes.c_double)])

    def copied(factor: float) -> Any:
        def function(x: Any, u: Any, out: Any) -> None:
            out[0] = factor * x[0]

        return signature(function)

    def constant(x: Any, u: Any, out: Any) -> None:
        out[0] = 2.0

    z, model = [1.0, 1.0], {"F": signature(constant), "h": copied(1.0), "Q": 1.0, "R": 1.0}
    filters.Ekf(copied(2.0), **model).run(z, 1.0, 1.0)
    with pytest.raises(ValueError, match=r"`F` is not the derivative of `f` at `x0`: element \(0, 0\) is 2, by differences 3;"):
        filters.Ekf(copied(3.0), **model).run(z, 1.0, 1.0)

    @signature
    def twice(x: Any, u: Any, out: Any) -> None:
        out[0] = out[1] = x[0]

    # It would write where the filter keeps something else.
    with pytest.raises(ValueError, match="`h` writes 2 numbers; expected 1"):
        filters.Ekf(copied(2.0), twice, Q=1.0, R=1.0).run(z, 1.0, 1.0)


def see(x: np.ndarray) -> np.ndarray:
    return x[:1]


def test_what_cannot_be_filtered_is_refused_with_its_reason() -> None:
    z = measured()
    with pytest.raises(ValueError, match="`F` has the shape"):
        filters.kalman(z, np.eye(3), H, Q, R, X0, P0)
    with pytest.raises(ZeroDivisionError):
        filters.Ekf(lambda x: [x[0], 1 / 0], lambda x: 1 / 0, Q=Q, R=R).run(z, X0, P0)
    with pytest.raises(ValueError, match="gave 3 numbers; expected 2"):
        filters.Ekf(lambda x: [1, 2, 3], lambda x: x[:1], Q=Q, R=R, check=False).run(z, X0, P0)
