"""Systems of other libraries, gains that settle, sensors of different times, and arrays of other libraries."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from test_filters_general import by_hand, samples, system

import kalmems
from kalmems import filters

A, B, C = np.array([[0.0, 1.0], [-4.0, -0.3]]), np.array([[0.0], [2.0]]), np.array([[1.0, 0.0]])


@pytest.mark.parametrize(("n", "m"), [(1, 1), (2, 1), (5, 3)])
def test_a_settled_gain_is_that_of_the_filter_after_many_samples(n: int, m: int) -> None:
    parts = system(n, m)
    _, z = samples(parts, 400)
    found = filters.steady(*(parts[name] for name in "FHQR"))
    long = filters.kalman(z, **parts)
    assert np.allclose(found.P, long.P[-1], rtol=1e-9, atol=1e-12)
    s = parts["H"] @ found.predicted @ parts["H"].T + parts["R"]
    assert np.allclose(s, long.S[-1], rtol=1e-9, atol=1e-12)
    # P⁻ = F·P·Fᵀ + Q.
    assert np.allclose(found.predicted, parts["F"] @ found.P @ parts["F"].T + parts["Q"], rtol=1e-9, atol=1e-12)
    begun = {**parts, "P0": found.predicted}
    constant = filters.constant_gain(z, **begun)
    expected = filters.kalman(z, **begun)
    assert np.allclose(constant.x, expected.x, atol=1e-9) and np.allclose(constant.P, expected.P, atol=1e-9)
    assert np.allclose(constant.log_likelihood, expected.log_likelihood, atol=1e-8)


def test_what_does_not_settle_is_refused() -> None:
    with pytest.raises(ArithmeticError, match="does not settle: a state grows that no measurement shows"):
        filters.steady(F=[[1.1, 0], [0, 0.5]], H=[0, 1], Q=[1, 1], R=1)
    with pytest.raises(ValueError, match=r"`F` has the shape \(2, 3\); expected \(2, 2\)"):
        filters.steady(F=np.ones((2, 3)), H=[0, 1], Q=[1, 1], R=1)


def test_the_covariance_of_a_constant_gain_is_that_of_its_errors() -> None:
    """Over 400 simulations; within 4 standard errors of a variance."""
    parts, gain, runs = system(2, 1), np.array([[0.3], [0.1]]), 400
    errors = []
    for _ in range(runs):
        states, z = samples(parts, 12)
        z[5] = np.nan
        found = filters.constant_gain(z, **parts, gain=gain)
        errors.append(found.x - states)
    assert np.isnan(found.nis[5]) and not found.taken[5]
    ratio = (np.array(errors) ** 2).mean(axis=0) / np.diagonal(found.P, axis1=1, axis2=2)
    assert np.abs(ratio - 1).max() < 4 * (2 / runs) ** 0.5
    with pytest.raises(ValueError, match=r"`gain` has the shape \(2, 2\); expected \(2, 1\)"):
        filters.constant_gain(z, **parts, gain=np.eye(2))


def test_a_continuous_system_is_sampled_as_its_solution_is() -> None:
    pytest.importorskip("scipy")
    parts = filters.from_state_space((A, B, C), interval=0.2, density=[0, 0.5])
    # By many small steps of the differential equations of mean and covariance.
    count, x, p = 20_000, np.array([1.0, -0.5]), np.zeros((2, 2))
    q = np.diag([0, 0.5])
    step = 0.2 / count
    for _ in range(count):
        middle = x + 0.5 * step * (A @ x + 3 * B[:, 0])
        x = x + step * (A @ middle + 3 * B[:, 0])
        half = p + 0.5 * step * (A @ p + p @ A.T + q)
        p = p + step * (A @ half + half @ A.T + q)
    assert np.allclose(parts["F"] @ [1.0, -0.5] + 3 * parts["B"][:, 0], x, atol=1e-9)
    assert np.allclose(parts["Q"], p, atol=1e-9)


def test_irregular_samples_have_matrices_of_their_own() -> None:
    pytest.importorskip("scipy")
    times = np.array([0.0, 0.1, 0.4, 0.5])
    parts = filters.from_state_space((A, B, C), interval=np.diff(times), density=[0, 0.5])
    assert parts["F"].shape == (4, 2, 2) and parts["H"].shape == (1, 2)
    whole = filters.from_state_space((A, B, C), interval=0.5, density=[0, 0.5])["F"]
    assert np.allclose(parts["F"][2] @ parts["F"][1] @ parts["F"][0], whole, atol=1e-14)
    found = filters.kalman([1.0, np.nan, np.nan, 0.9], **parts, R=0.1, x0=[0, 0], P0=[1, 1], u=np.zeros(4))
    direct = filters.from_state_space((A, B, C), interval=0.5, density=[0, 0.5])
    ends = filters.kalman([1.0, 0.9], **direct, R=0.1, x0=[0, 0], P0=[1, 1], u=np.zeros(2))
    assert np.allclose(found.x[-1], ends.x[-1], atol=1e-13) and np.allclose(found.P[-1], ends.P[-1], atol=1e-13)


@pytest.mark.parametrize("library", ["scipy", "control"])
def test_state_spaces_of_other_libraries_come_and_go(library: str) -> None:
    pytest.importorskip(library)
    expected = filters.from_state_space((A, B, C), interval=0.05)
    if library == "scipy":
        from scipy import signal

        continuous: Any = signal.StateSpace(A, B, C, [[0.0]])
        theirs = signal.cont2discrete((A, B, C, np.zeros((1, 1))), 0.05)[:2]
    else:
        import control

        continuous = control.ss(A, B, C, 0)
        theirs = tuple(np.asarray(getattr(control.sample_system(continuous, 0.05), name)) for name in "AB")
    parts = filters.from_state_space(continuous, interval=0.05)
    assert all(np.allclose(parts[name], matrix, atol=1e-13) for name, matrix in zip("FB", theirs, strict=True))
    sampled = filters.to_state_space(parts["F"], parts["H"], parts["B"], interval=0.05, library=library)
    again = filters.from_state_space(sampled)
    assert all(np.allclose(again[name], expected[name], atol=1e-13) for name in "FBH")
    with pytest.raises(ValueError, match=r"sampled every 0.05 s already; leave `interval` and `density` out"):
        filters.from_state_space(sampled, interval=0.1)


@pytest.mark.parametrize(
    ("call", "mend"),
    [
        (lambda: filters.from_state_space((A, B, C)), "give the `interval` between samples in s"),
        (lambda: filters.from_state_space((A, B, C, [[1.0]]), interval=1), "filter `z - u @ D.T`"),
        (lambda: filters.from_state_space((A, B), interval=1), r"expected \(A, B, C\)"),
        (lambda: filters.from_state_space((A, B, C, [[0.0]], True), interval=1), "at an interval that it does not state"),
        (lambda: filters.from_state_space((A, B, C), interval=-1), "steps that are not above 0"),
        (lambda: filters.from_state_space((A, B, C), interval=1, density=[1, 2, 3]), r"`density` has the shape \(3, 3\); expected \(2, 2\)"),
        (lambda: filters.to_state_space(A, C, interval=1, library="matlab"), "expected 'scipy' or 'control'"),
        (lambda: filters.together(([0.0, 1.0], [1.0])), "sensor 0 has times of the shape"),
        (lambda: filters.together(([0.0, 0.0], [1.0, 2.0])), "sensor 0 has two samples in one row"),
        (lambda: filters.together(), "there are no sensors"),
    ],
)
def test_systems_and_sensors_that_cannot_be_meant_are_refused(call: Any, mend: str) -> None:
    pytest.importorskip("scipy")
    with pytest.raises(ValueError, match=mend):
        call()


def test_samples_that_come_late_are_where_they_were_measured() -> None:
    """Two sensors of different rates, of which one arrives out of order: the answer is that of all samples in order."""
    pytest.importorskip("scipy")
    random = np.random.default_rng(3)
    fast, slow = np.arange(0, 5, 0.1), np.arange(0.05, 5, 0.7)
    z_fast, z_slow = np.sin(fast) + random.normal(0, 0.2, fast.size), np.sin(slow) + random.normal(0, 0.02, slow.size)
    order = random.permutation(slow.size)
    times, z = filters.together((fast, z_fast), (slow[order], z_slow[order]))
    assert times.size == fast.size + slow.size and np.all(np.diff(times) > 0)
    parts = filters.from_state_space(([[0, 1], [0, 0]], [[0], [1]], [[1, 0], [1, 0]]), interval=np.diff(times), density=[0, 1])
    given = {**{name: parts[name] for name in "FHQ"}, "R": np.diag([0.04, 4e-4]), "x0": np.zeros(2), "P0": np.eye(2)}
    found = filters.kalman(z, **given)
    expected = by_hand(z, given)
    assert np.allclose(found.x, expected["x"], atol=1e-10)
    near, both = filters.together(([0.0, 1.0], [1.0, 2.0]), ([0.001, 0.5], [3.0, 4.0]), tolerance=0.01)
    assert near.tolist() == [0.0, 0.5, 1.0] and np.array_equal(both, [[1, 3], [np.nan, 4], [2, np.nan]], equal_nan=True)


class Foreign:
    """An array of another library, as NumPy sees it."""

    def __init__(self, values: Any) -> None:
        self._values = np.asarray(values, dtype=np.float32)

    def __array__(self, dtype: Any = None, copy: Any = None) -> np.ndarray:
        return self._values.astype(dtype or np.float32)


@pytest.mark.parametrize("library", ["jax", "torch", "an array of its own"])
def test_arrays_of_other_libraries_are_taken(library: str) -> None:
    if library == "an array of its own":
        of: Any = Foreign
    elif library == "jax":
        of = pytest.importorskip("jax.numpy").asarray
    else:
        of = pytest.importorskip("torch").tensor
    z = np.sin(np.arange(50, dtype=np.float32))
    parts: dict[str, Any] = {"F": [[1.0, 0.5], [0.0, 1.0]], "H": [[1.0, 0.0]], "Q": [[0.0, 0.0], [0.0, 0.25]], "R": [[0.5]]}
    start: dict[str, Any] = {"x0": [0.0, 0.0], "P0": [[1.0, 0.0], [0.0, 1.0]]}
    expected = filters.kalman(z, **parts, **start)
    found = filters.kalman(of(z), **{name: of(value) for name, value in {**parts, **start}.items()})
    assert np.array_equal(found.x, expected.x) and np.array_equal(found.P, expected.P)
    motion, sensor = np.array(parts["F"]), np.array(parts["H"])
    model = filters.Ekf(lambda x: of((motion @ x).astype(np.float32)), lambda x: of((sensor @ x).astype(np.float32)), Q=of(parts["Q"]), R=of(parts["R"]))
    assert np.allclose(model.run(of(z), of(start["x0"]), of(start["P0"])).x, expected.x, atol=1e-2)


def test_a_tensor_that_carries_a_gradient_is_refused_with_its_mend() -> None:
    torch = pytest.importorskip("torch")
    parts: dict[str, Any] = {"F": 1, "H": 1, "Q": 1, "R": 1, "x0": 0, "P0": 1}
    z = torch.tensor([1.0, 2.0], dtype=torch.float64, requires_grad=True)
    with pytest.raises(ValueError, match=r"`z` cannot be read as numbers: .*detach"):
        filters.kalman(z, **parts)
    assert np.array_equal(filters.kalman(z.detach(), **parts).x, filters.kalman([1.0, 2.0], **parts).x)
    recording = kalmems.Recording({"time_s": [0.0, 1e-6], "cap_V": z, "drive_V": z.detach()})
    assert recording.columns == ("time_s", "drive_V") and "detach" in recording.unread["cap_V"]
    assert recording["drive_V"].tolist() == [1.0, 2.0]
