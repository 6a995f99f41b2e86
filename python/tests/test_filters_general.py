"""Filters of any size: missing numbers, matrices for each sample, gates, lags and the methods, against the equations written out in NumPy."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import pytest

from kalmems import filters

RNG = np.random.default_rng(2)


def system(n: int, m: int) -> dict[str, np.ndarray]:
    """A stable system with correlated noises."""
    turned = np.linalg.qr(RNG.normal(size=(n, n)))[0]
    root, noise = 0.1 * RNG.normal(size=(n, n)), 0.3 * RNG.normal(size=(m, m))
    return {
        "F": 0.95 * turned,
        "H": RNG.normal(size=(m, n)),
        "Q": root @ root.T + 1e-4 * np.eye(n),
        "R": noise @ noise.T + 0.01 * np.eye(m),
        "x0": RNG.normal(size=n),
        "P0": np.eye(n),
    }


def samples(parts: dict[str, np.ndarray], count: int) -> tuple[np.ndarray, np.ndarray]:
    """States and what is measured of them."""
    state, states, rows = RNG.multivariate_normal(parts["x0"], parts["P0"]), [], []
    for k in range(count):
        of = {name: matrix[k] if matrix.ndim == 3 else matrix for name, matrix in parts.items()}
        states.append(state)
        rows.append(of["H"] @ state + RNG.multivariate_normal(np.zeros(len(of["R"])), of["R"]))
        state = of["F"] @ state + RNG.multivariate_normal(np.zeros(len(state)), of["Q"])
    return np.array(states), np.array(rows)


def by_hand(z: np.ndarray, parts: dict[str, np.ndarray], largest: float = np.inf) -> dict[str, np.ndarray]:
    """All numbers of a sample at once, by the textbook's equations, without those that are missing."""
    x, p, found = parts["x0"], parts["P0"], {"x": [], "P": [], "nis": [], "log_likelihood": []}
    for k, row in enumerate(z):
        at = {name: parts[name][k] if parts[name].ndim == 3 else parts[name] for name in ("H", "R")}
        if k > 0:
            f, q = (parts[name][k - 1] if parts[name].ndim == 3 else parts[name] for name in ("F", "Q"))
            x, p = f @ x, f @ p @ f.T + q
        there = ~np.isnan(row)
        nis = likelihood = np.nan
        if there.any():
            h, r = at["H"][there], at["R"][np.ix_(there, there)]
            s, residual = h @ p @ h.T + r, row[there] - h @ x
            nis = residual @ np.linalg.solve(s, residual)
            likelihood = -0.5 * (nis + np.linalg.slogdet(2 * np.pi * s)[1])
            if nis <= largest:
                gain = p @ h.T @ np.linalg.inv(s)
                x, p = x + gain @ residual, p - gain @ s @ gain.T
        for name, value in (("x", x), ("P", p), ("nis", nis), ("log_likelihood", likelihood)):
            found[name].append(value)
    return {name: np.array(values) for name, values in found.items()}


def equal(found: filters.Filtered, expected: dict[str, np.ndarray], tolerance: float = 1e-9) -> None:
    for name, values in expected.items():
        assert np.allclose(getattr(found, name), values, rtol=tolerance, atol=tolerance, equal_nan=True), name


@pytest.mark.parametrize(("n", "m"), [(1, 16), (3, 4), (7, 1), (12, 5), (24, 16)])
def test_filters_of_any_size_are_those_of_the_equations(n: int, m: int) -> None:
    parts = system(n, m)
    _, z = samples(parts, 60)
    z[RNG.uniform(size=z.shape) < 0.3] = np.nan
    z[5] = np.nan
    expected = by_hand(z, parts)
    equal(filters.kalman(z, **parts), expected)
    equal(filters.kalman(z, **parts, square_root=True), expected)
    found = filters.kalman(z, **parts)
    assert np.array_equal(found.taken, ~np.isnan(z).all(axis=1))
    assert np.array_equal(np.isnan(found.innovation), np.isnan(z))
    if n <= 12:
        f, h = (lambda x: parts["F"] @ x), (lambda x: parts["H"] @ x)
        noise = {"Q": parts["Q"], "R": parts["R"]}
        kinds = [filters.Ekf(f, h, **noise), filters.Ekf(f, h, **noise, iterated=True), filters.Ekf(f, h, **noise, square_root=True)]
        kinds += [filters.Ukf(f, h, **noise), filters.Ukf(f, h, **noise, square_root=True)]
        for kind in kinds:
            equal(kind.run(z, parts["x0"], parts["P0"]), expected, 1e-6)


def test_of_two_sensors_one_goes_on_where_the_other_is_missing() -> None:
    """A fast sensor of a walk, and one of a tenth of its rate that is ten times as good."""
    parts = {"F": np.eye(1), "H": np.ones((2, 1)), "Q": np.array([[1e-4]]), "R": np.diag([0.04, 4e-4]), "x0": np.zeros(1), "P0": np.eye(1)}
    states, z = samples(parts, 5000)
    z[np.arange(len(z)) % 10 != 0, 1] = np.nan
    found = filters.kalman(z, **parts)
    error = (found.x - states)[100:, 0]
    assert 0.8 < np.mean(error**2) / np.mean(found.P[100:, 0, 0]) < 1.25
    alone = filters.kalman(z[:, :1], **{**parts, "H": np.ones((1, 1)), "R": parts["R"][:1, :1]})
    assert np.std(error) < 0.7 * np.std((alone.x - states)[100:, 0])


def test_each_sample_may_have_matrices_of_its_own() -> None:
    count, first, second = 40, system(3, 2), system(3, 2)
    parts = {**first, **{name: np.stack([(first, second)[k % 2][name] for k in range(count)]) for name in ("F", "H", "Q", "R")}}
    _, z = samples(parts, count)
    equal(filters.kalman(z, **parts), by_hand(z, parts))
    other = {**parts, "F": first["F"], "H": first["H"]}
    model = filters.Ekf(lambda x: first["F"] @ x, lambda x: first["H"] @ x, Q=parts["Q"], R=parts["R"])
    equal(model.run(z, parts["x0"], parts["P0"]), by_hand(z, other), 1e-7)
    with pytest.raises(ValueError, match=r"`F` has the shape \[39, 3, 3\]; expected \[3, 3\] or \[40, 3, 3\]"):
        filters.kalman(z, **{**parts, "F": parts["F"][1:]})
    wrong = parts["R"].copy()
    wrong[7, 0, 1] += 1
    with pytest.raises(ValueError, match=r"`R` is not symmetric at sample 7: element \(0, 1\)"):
        filters.kalman(z, **{**parts, "R": wrong})


def test_a_sample_beyond_the_largest_nis_corrects_nothing_and_is_counted() -> None:
    for m in (1, 3):
        parts = system(2, m)
        _, z = samples(parts, 200)
        z[[20, 90]] += 100
        found = filters.kalman(z, **parts, largest_nis=40)
        equal(found, by_hand(z, parts, 40))
        assert list(np.flatnonzero(~found.taken)) == [20, 90]
        assert "2 of them rejected" in repr(found)
    with pytest.raises(ValueError, match="`largest_nis` is -1"):
        filters.kalman(z, **parts, largest_nis=-1)


def test_a_lag_is_the_smoother_of_the_samples_until_then() -> None:
    parts, lag = system(3, 2), 6
    _, z = samples(parts, 50)
    z[11, 0] = np.nan
    found = filters.kalman(z, **parts, smooth=lag).smoothed
    assert found is not None
    for k in range(50):
        whole = filters.kalman(z[: k + lag + 1], **parts, smooth=True).smoothed
        assert whole is not None
        assert np.allclose(found.x[k], whole.x[k], atol=1e-12) and np.allclose(found.P[k], whole.P[k], atol=1e-12)
    assert filters.kalman(z, **parts, smooth=False).smoothed is None
    for wrong in (0, -3, 2.5):
        with pytest.raises(ValueError, match="`smooth` is"):
            filters.kalman(z, **parts, smooth=wrong)  # type: ignore[arg-type]


def seen(x: np.ndarray) -> np.ndarray:
    """Distance and bearing of a place."""
    return np.array([np.hypot(x[0], x[1]), np.arctan2(x[1], x[0])])


def bent(kind: str) -> tuple[filters.Ekf | filters.Ukf, dict[str, Any]]:
    noise = {"Q": 1e-6 * np.eye(2), "R": np.array([[1e-2, 3e-4], [3e-4, 4e-4]])}
    model = filters.Ukf(lambda x: x, seen, **noise) if kind == "ukf" else filters.Ekf(lambda x: x, seen, **noise)
    return model, noise


def test_numbers_of_a_nonlinear_sensor_correct_together() -> None:
    """The first correction of the extended and of the unscented filter by two numbers, by the textbook's equations."""
    x0, p0, z = np.array([3.0, 2.0]), np.array([[0.3, 0.05], [0.05, 0.2]]), np.array([[3.9, 0.5]])
    model, noise = bent("ekf")
    found = model.run(z, x0, p0)
    r = np.hypot(*x0)
    h = np.array([[x0[0] / r, x0[1] / r], [-x0[1] / r**2, x0[0] / r**2]])
    s = h @ p0 @ h.T + noise["R"]
    gain = p0 @ h.T @ np.linalg.inv(s)
    assert np.allclose(found.x[0], x0 + gain @ (z[0] - seen(x0)), atol=1e-8)
    assert np.allclose(found.P[0], p0 - gain @ s @ gain.T, atol=1e-8)
    model, noise = bent("ukf")
    found = model.run(z, x0, p0)
    # α = 1, β = 2, κ = 1: λ = 1.
    root = np.linalg.cholesky(3 * p0)
    points = np.array([x0, *(x0 + root.T), *(x0 - root.T)])
    of_mean, of_covariance = np.array([1 / 3, *4 * [1 / 6]]), np.array([1 / 3 + 2, *4 * [1 / 6]])
    values = np.array([seen(point) for point in points])
    off, from_mean = values - of_mean @ values, points - x0
    s = (of_covariance[:, None] * off).T @ off + noise["R"]
    gain = (of_covariance[:, None] * from_mean).T @ off @ np.linalg.inv(s)
    assert np.allclose(found.S[0], s, atol=1e-12)
    assert np.allclose(found.x[0], x0 + gain @ (z[0] - of_mean @ values), atol=1e-10)
    assert np.allclose(found.P[0], p0 - gain @ s @ gain.T, atol=1e-10)


def test_an_iterated_filter_ends_where_the_posterior_is_largest() -> None:
    x0, p0, z = np.array([3.0]), np.array([[4.0]]), np.array([[1.0]])
    found = filters.Ekf(lambda x: x, lambda x: x**2 / 4, Q=1e-9, R=1e-2, iterated=True).run(z, x0, p0)
    at = np.linspace(0.5, 4, 350_001)
    cost = (at - 3) ** 2 / 4 + (at**2 / 4 - 1) ** 2 / 1e-2
    assert found.x[0, 0] == pytest.approx(at[cost.argmin()], abs=1e-3)


def test_more_states_than_a_method_has_are_refused() -> None:
    z = np.ones((3, 1))
    with pytest.raises(ValueError, match="25 states and 1 measurements; a filter has 1 to 24 states and 1 to 16 measurements"):
        filters.kalman(z, np.eye(25), np.ones((1, 25)), np.eye(25), 1, np.zeros(25), np.eye(25))
    with pytest.raises(ValueError, match="13 states; this filter has at most 12"):
        filters.Ukf(lambda x: x, lambda x: x[:1], Q=np.eye(13), R=1).run(z, np.zeros(13), np.eye(13))
    with pytest.raises(ValueError, match="no iterated filter in square-root form"):
        filters.Ekf(seen, seen, Q=1, R=1, iterated=True, square_root=True)


def test_claims_hold_where_the_model_is_true_and_not_where_it_is_wrong() -> None:
    parts = system(3, 2)
    right = filters.consistency(parts, 100, runs=200, seed=4)
    assert right.holds and len(right.coverage) == 3
    assert all(low < 1 < high for _, (low, high) in (right.nis, right.nees)), right
    wrong = filters.consistency(parts, 100, runs=50, truth={"R": 4 * parts["R"]})
    assert not wrong.holds and wrong.nees[0] > 1.3 and wrong.nis[0] > 1.3
    careful = filters.consistency({**parts, "R": 4 * parts["R"]}, 100, runs=50, truth={"R": parts["R"]})
    assert careful.holds and careful.nees[0] < 0.9
    functions = {"f": lambda x: x, "h": seen, "Q": [1e-6, 1e-6], "R": [1e-2, 4e-4], "x0": [3, 2], "P0": [1e-2, 1e-2]}
    for kind in (filters.Ekf, filters.Ukf):
        assert filters.consistency({**functions, "filter": kind}, 30, runs=50).holds
    with pytest.raises(ValueError, match="`runs` is 1"):
        filters.consistency(parts, 100, runs=1)


def test_several_recordings_are_filtered_by_threads() -> None:
    parts = system(3, 2)
    recordings = [samples(parts, 50)[1] for _ in range(6)]
    with ThreadPoolExecutor(3) as threads:
        together = list(threads.map(lambda z: filters.kalman(z, **parts, smooth=True).x, recordings))
    assert all(np.array_equal(x, filters.kalman(z, **parts).x) for x, z in zip(together, recordings, strict=True))
