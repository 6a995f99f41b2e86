"""Problems of the documentation of filterpy and of the book "Kalman and Bayesian Filters in Python" (Labbe), with the numbers that filterpy computes.

Models and constants are those of the sources; samples are simulated here. filterpy predicts before its first sample, which a first row of missing
samples does as well.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pytest

from kalmems import filters

filterpy = pytest.importorskip("filterpy.kalman")
common = pytest.importorskip("filterpy.common")
Numbers = np.ndarray


def random(seed: int) -> np.random.Generator:
    return np.random.default_rng(seed)


def late(rows: Any) -> Numbers:
    """The samples after a row without any."""
    z = np.asarray(rows, dtype=float)
    z = z.reshape(-1, 1) if z.ndim == 1 else z
    return np.vstack([np.full((1, z.shape[1]), np.nan), z])


def same(found: filters.Filtered, means: Sequence[Any], covariances: Sequence[Any], tolerance: float = 1e-9) -> None:
    x, p = np.array([np.ravel(one) for one in means]), np.array(covariances)
    assert np.allclose(found.x[1:], x, rtol=tolerance, atol=tolerance), np.abs(found.x[1:] - x).max()
    assert np.allclose(found.P[1:], p, rtol=tolerance, atol=tolerance), np.abs(found.P[1:] - p).max()


def linear(parts: dict[str, Any], rows: Any, inputs: Numbers | None = None) -> tuple[list[Numbers], list[Numbers], float]:
    """filterpy's filter of a linear system; a sample of `nan` is none."""
    n, z = len(parts["x0"]), np.asarray(rows, dtype=float)
    z = z.reshape(-1, 1) if z.ndim == 1 else z
    kf = filterpy.KalmanFilter(dim_x=n, dim_z=z.shape[1], dim_u=0 if inputs is None else inputs.shape[1])
    kf.x, kf.P = np.array(parts["x0"], dtype=float), np.array(parts["P0"], dtype=float)
    kf.F, kf.H, kf.Q, kf.R = (np.atleast_2d(np.array(parts[name], dtype=float)) for name in "FHQR")
    means, covariances, likelihood = [], [], 0.0
    for k, row in enumerate(z):
        if inputs is None:
            kf.predict()
        else:
            kf.predict(u=inputs[k], B=np.array(parts["B"], dtype=float))
        if np.isfinite(row).all():
            kf.update(row)
            likelihood += kf.log_likelihood
        means.append(kf.x.copy())
        covariances.append(kf.P.copy())
    return means, covariances, likelihood


def walk(dt: float, variance: float) -> Numbers:
    return np.asarray(common.Q_discrete_white_noise(2, dt, variance))


def of_the_documentation() -> dict[str, Any]:
    """A position and a velocity, filterpy's first example."""
    return {"F": [[1, 1], [0, 1]], "H": [[1, 0]], "Q": walk(0.1, 0.13), "R": [[5]], "x0": [2, 0], "P0": 1000 * np.eye(2)}


def of_a_dog(noise: float, of_samples: float) -> dict[str, Any]:
    """The book's dog in a corridor: positions in m every second."""
    return {"F": [[1, 1], [0, 1]], "H": [[1, 0]], "Q": walk(1, noise), "R": [[of_samples]], "x0": [0, 0], "P0": np.diag([500, 49])}


def of_a_robot() -> dict[str, Any]:
    """The book's robot in the plane, in m, whose sensor reports feet."""
    motion, foot = np.array([[1.0, 1.0], [0.0, 1.0]]), 0.3048
    whole = np.kron(np.eye(2), motion)
    seen = np.zeros((2, 4))
    seen[0, 0] = seen[1, 2] = 1 / foot
    return {"F": whole, "H": seen, "Q": np.kron(np.eye(2), walk(1, 0.001)), "R": 5 * np.eye(2), "x0": np.zeros(4), "P0": 500 * np.eye(4)}


@pytest.mark.parametrize(
    ("parts", "count"),
    [(of_the_documentation(), 60), (of_a_dog(0.01, 10), 50), (of_a_dog(2.0, 225), 50), (of_a_dog(0.05, 0.2), 30), (of_a_robot(), 30)],
    ids=["documentation", "dog", "dog with much noise", "dog with a good sensor", "robot in feet"],
)
def test_positions_and_velocities(parts: dict[str, Any], count: int) -> None:
    sensor = np.atleast_2d(parts["H"])
    track = np.arange(1, count + 1.0)
    states = np.stack([track if k % 2 == 0 else np.ones(count) for k in range(sensor.shape[1])])
    z = (sensor @ states).T + random(1).normal(0, np.sqrt(np.diag(parts["R"])), (count, len(sensor)))
    found = filters.kalman(late(z), **parts, smooth=True)
    means, covariances, likelihood = linear(parts, z)
    same(found, means, covariances)
    assert np.nansum(found.log_likelihood) == pytest.approx(likelihood, rel=1e-12)
    smoothed, spread, *_ = _with(parts).rts_smoother(np.array(means), np.array(covariances))
    assert found.smoothed is not None
    assert np.allclose(found.smoothed.x[1:], smoothed, rtol=1e-7, atol=1e-7) and np.allclose(found.smoothed.P[1:], spread, rtol=1e-6, atol=1e-7)


def _with(parts: dict[str, Any]) -> Any:
    kf = filterpy.KalmanFilter(dim_x=len(parts["x0"]), dim_z=len(np.atleast_2d(parts["H"])))
    kf.F, kf.Q = np.array(parts["F"], dtype=float), np.array(parts["Q"], dtype=float)
    return kf


def test_a_single_number_that_is_tracked() -> None:
    """The book's first filter: N(0, 20²), a velocity of 1 m/s that is known, process variance 1, sensor variance 2."""
    z = np.arange(1, 11) + random(2).normal(0, 2**0.5, 10)
    parts = {"F": [[1]], "H": [[1]], "Q": [[1]], "R": [[2]], "x0": [0], "P0": [[400]], "B": [[1]]}
    found = filters.kalman(late(z), **parts, u=np.ones(11))
    means, covariances, _ = linear(parts, z, np.ones((10, 1)))
    same(found, means, covariances)


def test_a_sensor_that_fails_for_a_while_and_a_control_input() -> None:
    parts = {**of_the_documentation(), "B": [[0.5], [1.0]]}
    z = np.arange(40.0) + random(3).normal(0, 5**0.5, 40)
    z[15:22] = np.nan
    u = np.sin(np.arange(41.0))[:, None]
    means, covariances, _ = linear(parts, z, u[:40])
    same(filters.kalman(late(z), **parts, u=u), means, covariances)


def test_two_sensors_of_a_train() -> None:
    """The book's fusion of a wheel and a position sensor, with variances that differ by 36."""
    parts = {"F": [[1, 1], [0, 1]], "H": [[1, 0], [1, 0]], "Q": walk(1, 0.02), "R": np.diag([1.5**2, 9.0]), "x0": [0, 0], "P0": np.diag([50.0, 3])}
    z = np.arange(1, 101.0)[:, None] + random(4).normal(0, [1.5, 3], (100, 2))
    means, covariances, likelihood = linear(parts, z)
    found = filters.kalman(late(z), **parts)
    same(found, means, covariances)
    assert np.nansum(found.log_likelihood) == pytest.approx(likelihood, rel=1e-12)


def test_a_radar_by_the_extended_filter() -> None:
    """The slant range of an aircraft, in m every 50 ms: distance, velocity and altitude; the start is off by 100 m, 100 m/s and 2000 m."""
    dt, q = 0.05, np.zeros((3, 3))
    q[:2, :2] = walk(dt, 0.1)
    motion = np.eye(3) + dt * np.array([[0.0, 1, 0], [0, 0, 0], [0, 0, 0]])
    start, before, r = np.array([-100.0, 100, 2000]), 50 * np.eye(3), 25.0

    def h(x: Numbers) -> Numbers:
        return np.array([np.hypot(x[0], x[2])])

    def slope(x: Numbers) -> Numbers:
        return np.array([[x[0], 0, x[2]]]) / np.hypot(x[0], x[2])

    z = np.hypot(100 * np.arange(1, 401) * dt, 1000) + random(5).normal(0, 5, 400)
    ekf = filterpy.ExtendedKalmanFilter(dim_x=3, dim_z=1)
    ekf.x, ekf.P, ekf.F, ekf.Q, ekf.R = start.copy(), before.copy(), motion, q, np.array([[r]])
    means, covariances = [], []
    for value in z:
        ekf.predict()
        ekf.update(np.array([value]), slope, h)
        means.append(ekf.x.copy())
        covariances.append(ekf.P.copy())
    found = filters.Ekf(lambda x: motion @ x, h, Q=q, R=r, F=lambda x: motion, H=slope).run(late(z), start, before)
    same(found, means, covariances, 1e-8)


def of_points(
    parts: tuple[Callable[[Numbers], Numbers], Callable[[Numbers], Numbers]], noise: tuple[Any, Any], start: tuple[Any, Any], spread: tuple[float, float, float], z: Numbers
) -> None:
    f, h = parts
    (q, r), (x0, p0), (alpha, beta, kappa) = noise, start, spread
    points = filterpy.MerweScaledSigmaPoints(len(x0), alpha=alpha, beta=beta, kappa=kappa)
    ukf = filterpy.UnscentedKalmanFilter(dim_x=len(x0), dim_z=z.shape[1], dt=1.0, fx=lambda x, dt: f(x), hx=h, points=points)
    ukf.x, ukf.P, ukf.Q, ukf.R = np.array(x0, dtype=float), np.array(p0, dtype=float), q, r
    means, covariances = [], []
    for row in z:
        ukf.predict()
        ukf.update(row)
        means.append(ukf.x.copy())
        covariances.append(ukf.P.copy())
    ours = filters.Ukf(f, h, Q=q, R=r, alpha=alpha, beta=beta, kappa=kappa)
    same(ours.run(late(z), x0, p0), means, covariances, 1e-6)


def test_positions_by_the_unscented_filter() -> None:
    """filterpy's example: two axes, a standard deviation of 0.09 in each, α = 0.1, β = 2, κ = −1."""
    motion = np.kron(np.eye(2), np.array([[1, 0.1], [0, 1]]))
    q, r = np.kron(np.eye(2), walk(0.1, 0.01**2)), np.diag([0.09**2, 0.09**2])
    z = np.arange(50.0)[:, None] + random(6).normal(0, 0.09, (50, 2))
    of_points((lambda x: motion @ x, lambda x: x[[0, 2]]), (q, r), ([-1.0, 1, -1, 1], 0.2 * np.eye(4)), (0.1, 2.0, -1.0), z)


def test_a_climbing_aircraft_by_the_unscented_filter() -> None:
    """The book's radar of range and elevation every 3 s: distance, its rate, altitude; 5 m and 0.5°."""
    dt, elevation = 3.0, np.radians(0.5)
    motion = np.eye(3)
    motion[0, 1] = dt
    q = np.zeros((3, 3))
    q[:2, :2], q[2, 2] = walk(dt, 0.1), 0.1

    def h(x: Numbers) -> Numbers:
        return np.array([np.hypot(x[0], x[2]), np.arctan2(x[2], x[0])])

    track = np.stack([100 * dt * np.arange(1, 121), np.full(120, 100.0), np.full(120, 1000.0)], axis=1)
    z = np.array([h(x) for x in track]) + random(7).normal(0, [5, elevation], (120, 2))
    start = ([0.0, 90, 1100], np.diag([300.0**2, 30**2, 150**2]))
    of_points((lambda x: motion @ x, h), (q, np.diag([25, elevation**2])), start, (0.1, 2.0, 0.0), z)


def test_a_manoeuvre_by_interacting_models() -> None:
    """Two models of a position, of which one has a thousand times the process noise."""
    motion, seen, count = np.array([[1.0, 1.0], [0.0, 1.0]]), np.array([[1.0, 0.0]]), 60
    quiet, moving = walk(1, 1e-3), walk(1, 1.0)
    switching, chances = np.array([[0.97, 0.03], [0.03, 0.97]]), np.array([0.5, 0.5])
    track = np.cumsum(np.where(np.arange(count) < 30, 1.0, -2.0))
    z = track + random(8).normal(0, 1, count)

    def made(noise: Numbers) -> Any:
        kf = filterpy.KalmanFilter(dim_x=2, dim_z=1)
        kf.x, kf.P, kf.F, kf.H, kf.Q, kf.R = np.zeros(2), 10 * np.eye(2), motion, seen, noise, np.eye(1)
        return kf

    imm = filterpy.IMMEstimator([made(quiet), made(moving)], chances, switching)
    means, covariances, probabilities = [], [], []
    for value in z:
        imm.predict()
        imm.update(value)
        means.append(imm.x.copy())
        covariances.append(imm.P.copy())
        probabilities.append(imm.mu.copy())
    models = [{"F": motion, "H": seen, "Q": noise, "R": 1.0} for noise in (quiet, moving)]
    found = filters.interacting(late(z), models, switching, np.zeros(2), 10 * np.eye(2), chances=chances)
    same(found, means, covariances)
    assert found.models is not None and np.allclose(found.models[1:], probabilities, atol=1e-9)


def test_weights_by_a_filter_of_two_gains() -> None:
    """The book's g-h filter of a weight, g = 0.6 and h = 2/3, with the book's twelve readings in lb."""
    gh = pytest.importorskip("filterpy.gh")
    weights = [158.0, 164.2, 160.3, 159.9, 162.1, 164.6, 169.6, 167.4, 166.4, 171.0, 171.2, 172.6]
    one = gh.GHFilter(x=160.0, dx=1.0, dt=1.0, g=6 / 10, h=2 / 3)
    expected = [one.update(z=weight)[:2] for weight in weights]
    found = filters.constant_gain(
        late(weights), F=[[1, 1], [0, 1]], H=[1, 0], Q=[0, 0], R=1, x0=[160, 1], P0=[1, 1], gain=[6 / 10, 2 / 3]
    )
    assert np.allclose(found.x[1:], expected, atol=1e-12)


def test_discrete_noise_of_a_density() -> None:
    """The numbers that the documentation of `van_loan_discretization` prints, of y″ + y = 2·u(t) (Brown and Hwang), and those of a density."""
    parts = filters.from_state_space(([[0, 1], [-1, 0]], [[0], [0]], [[1, 0]]), interval=0.1, density=[0, 4])
    assert np.allclose(parts["F"], [[0.99500417, 0.09983342], [-0.09983342, 0.99500417]], atol=5e-9)
    assert np.allclose(parts["Q"], [[0.00133067, 0.01993342], [0.01993342, 0.39866933]], atol=5e-9)
    free = filters.from_state_space(([[0, 1], [0, 0]], [[0], [0]], [[1, 0]]), interval=0.3, density=[0, 0.7])
    assert np.allclose(free["Q"], common.Q_continuous_white_noise(2, 0.3, 0.7), atol=1e-15)


def test_a_robot_among_landmarks_by_particles() -> None:
    """Distances to the book's four landmarks; the mean of 4000 particles is at the robot as well as that of the extended filter's ellipse says."""
    landmarks, path = np.array([[-1.0, 2], [5, 10], [12, 14], [18, 21]]), np.stack([np.arange(1, 19.0)] * 2, axis=1)

    def h(x: Numbers) -> Numbers:
        return np.array([np.hypot(x[0] - a, x[1] - b) for a, b in landmarks])

    def f(x: Numbers) -> Numbers:
        return np.array([x[0] + 1, x[1] + 1])

    z = np.array([h(x) for x in path]) + random(9).normal(0, 0.1, (18, 4))
    model = {"Q": 0.05**2 * np.eye(2), "R": 0.1**2 * np.eye(4)}
    particles = filters.Particles(f, h, **model, members=4000, seed=1).run(z, [1, 1], 0.25 * np.eye(2))
    ellipse = filters.Ekf(f, h, **model).run(z, [1, 1], 0.25 * np.eye(2))
    assert np.all(np.abs(particles.x - ellipse.x) < 0.3 * ellipse.sd)
    assert np.abs(particles.x - path).max() < 4 * ellipse.sd.max()
