"""The verdict on filters of one's own, and noise of samples with heavy tails."""

from __future__ import annotations

import math

import numpy as np
import pytest
from test_filters_general import samples, system

import kalmems
from kalmems import filters

RNG = np.random.default_rng(12)


def level(count: int, seed: int = 0) -> np.ndarray:
    random = np.random.default_rng(seed)
    return np.cumsum(random.normal(0, 0.1, count)) + random.normal(0, 0.5, count)


def test_grades_of_consistent_filters_pass_and_of_wrong_ones_do_not() -> None:
    graded = []
    for seed in range(40):
        found = filters.verdict(filters.kalman(level(3000, seed), F=1, H=1, Q=0.01, R=0.25, x0=0, P0=1))
        graded.append(found.grade)
        assert found.failing == [] and found.updates == 3000
    # A mean NIS outside of its interval is a remark: of 40, by chance 0 to 7 in all but one of a thousand cases.
    assert set(graded) <= {"passes", "passes with remarks"} and graded.count("passes with remarks") <= 7
    z = level(3000)
    wrong = {
        "failed": filters.kalman(z, F=1, H=1, Q=0.01, R=0.05, x0=0, P0=1),
        "doubtful": filters.kalman(z, F=1, H=1, Q=1e-3, R=0.25, x0=0, P0=1),
    }
    for grade, found in wrong.items():
        seen = filters.verdict(found)
        assert seen.grade == grade, seen
        assert seen.failing and all(one.p_value < 1e-6 for one in seen.failing)
    assert filters.verdict(filters.kalman(z, F=1, H=1, Q=0.01, R=100, x0=0, P0=1)).grade == "doubtful"


def test_a_verdict_names_what_and_where() -> None:
    z = level(4000)
    z += 0.5 * np.sin(2 * np.pi * 20 * 0.01 * np.arange(4000))
    found = filters.verdict(filters.kalman(z, F=1, H=1, Q=0.01, R=0.25, x0=0, P0=1), interval=0.01)
    line = next(one for one in found.findings if one.test == "lines")
    assert line.fails and "20 Hz" in line.text and "interference" in line.text
    assert "interference" in repr(found) and repr(found).startswith("<FilterVerdict: doubtful, mean NIS ")
    jumped = level(4000)
    jumped[2000] += 10
    outlier = next(one for one in filters.verdict(filters.kalman(jumped, F=1, H=1, Q=0.01, R=0.25, x0=0, P0=1)).failing if "largest" in one.test)
    assert "at 2000 s" in outlier.text or "at 2.000 ks" in outlier.text or "2 ks" in outlier.text, outlier


def test_innovations_of_any_library_are_judged_and_those_of_several_signals_by_name() -> None:
    parts = system(3, 2)
    _, z = samples(parts, 3000)
    z[RNG.uniform(size=z.shape) < 0.1] = np.nan
    found = filters.kalman(z, **parts)
    own, arrays = filters.verdict(found), filters.verdict(found.innovation, found.S)
    assert own.grade == arrays.grade and own.mean_nis == pytest.approx(arrays.mean_nis, rel=1e-9)
    assert own.updates == np.isfinite(z).sum() and own.failing == []
    z[1::2, 1] += 1.0
    bad = filters.verdict(filters.kalman(z, **parts), names=["position", "bearing"])
    assert bad.grade == "failed" or bad.grade == "doubtful"
    assert any("bearing" in one.text for one in bad.failing)


def test_a_constant_gain_is_judged_by_its_size_alone() -> None:
    z = level(3000)
    found = filters.constant_gain(z, F=1, H=1, Q=0.01, R=0.25, x0=0, P0=1, gain=0.6)
    assert filters.verdict(found).grade == "doubtful"
    kept = filters.verdict(found, whitens=False)
    assert kept.grade in ("passes", "passes with remarks") and len(kept.findings) == 1


@pytest.mark.filterwarnings("ignore::kalmems.VerdictWarning")
def test_the_verdict_of_an_experiment_is_that_of_its_innovations() -> None:
    """The EKF of the example: the same tests of its innovations find the same as in its report."""
    from conftest import EXAMPLES

    result = kalmems.Experiment.load(EXAMPLES / "shared_scanner/experiment.toml").estimate(strict=False)
    ekf = result["EKF"]
    skip = ekf.time >= 0.008
    found = filters.verdict(ekf.innovation[skip], ekf.innovation_sd[skip] ** 2, times=ekf.time[skip])
    assert found.grade in ("doubtful", "failed") and ekf.grade == "doubtful"


@pytest.mark.parametrize(
    ("call", "mend"),
    [
        (lambda z: filters.verdict(z), "give `S` as well"),
        (lambda z: filters.verdict(z, np.eye(2)), r"`S` has the shape \(2, 2\); expected \(1, 1\)"),
        (lambda z: filters.verdict(z, 1.0, times=[1.0]), r"expected increasing times in s, of the shape \(50,\)"),
        (lambda z: filters.verdict(z, 1.0, times=np.arange(50), interval=1), "give one of them"),
        (lambda z: filters.verdict(z, 1.0, interval=0), "above 0"),
        (lambda z: filters.verdict(z, 1.0, names=["a", "b"]), "there are 1 measurements"),
        (lambda z: filters.verdict(np.nan * z, 1.0), "there is nothing to test"),
        (lambda z: filters.kalman(z, 1, 1, 1, 1, 0, 1, degrees_of_freedom=2), "expected more than 2"),
    ],
)
def test_what_cannot_be_judged_is_refused(call: object, mend: str) -> None:
    with pytest.raises(ValueError, match=mend):
        call(RNG.normal(size=50))  # type: ignore[operator]


def by_hand(z: np.ndarray, parts: dict[str, np.ndarray], freedom: float) -> tuple[np.ndarray, np.ndarray, float]:
    """The update of Agamennoni and others in the form with the gain, iterated to the end."""
    x, p, means, covariances, likelihood = parts["x0"], parts["P0"], [], [], 0.0
    h, r, m = parts["H"], parts["R"], len(parts["R"])
    for k, row in enumerate(z):
        if k > 0:
            x, p = parts["F"] @ x, parts["F"] @ p @ parts["F"].T + parts["Q"]
        scale, left = h @ p @ h.T + r, row - h @ x
        square = left @ np.linalg.solve(scale, left)
        likelihood += math.lgamma((freedom + m) / 2) - math.lgamma(freedom / 2) - 0.5 * np.linalg.slogdet(freedom * np.pi * scale)[1]
        likelihood -= (freedom + m) / 2 * np.log1p(square / freedom)
        weight = 1.0
        for _ in range(500):
            s = h @ p @ h.T + r / weight
            gain = p @ h.T @ np.linalg.inv(s)
            after, spread = x + gain @ left, p - gain @ s @ gain.T
            rest = row - h @ after
            weight = (freedom + m) / (freedom + np.trace(np.linalg.solve(r, np.outer(rest, rest) + h @ spread @ h.T)))
        x, p = after, spread
        means.append(x)
        covariances.append(p)
    return np.array(means), np.array(covariances), likelihood


@pytest.mark.parametrize(("n", "m"), [(2, 1), (3, 3)])
def test_student_noise_is_taken_by_the_equations_of_the_paper(n: int, m: int) -> None:
    parts = system(n, m)
    _, z = samples(parts, 60)
    z[::7] += RNG.normal(0, 3, z[::7].shape)
    means, covariances, likelihood = by_hand(z, parts, 4.0)
    found = filters.kalman(z, **parts, degrees_of_freedom=4)
    assert np.allclose(found.x, means, atol=1e-6) and np.allclose(found.P, covariances, atol=1e-6)
    assert found.log_likelihood.sum() == pytest.approx(likelihood, rel=1e-6)
    normal = filters.kalman(z, **parts, degrees_of_freedom=1e12)
    assert np.allclose(normal.x, filters.kalman(z, **parts).x, atol=1e-9)


def test_outliers_disturb_a_filter_of_student_noise_less() -> None:
    """A fiftieth of the samples is off by 20 standard deviations."""
    random = np.random.default_rng(5)
    x = np.cumsum(random.normal(0, 0.1, 4000))
    z = x + random.normal(0, 0.5, 4000)
    z[random.uniform(size=4000) < 0.02] += 10
    kinds = [filters.Ekf(lambda x: x, lambda x: x, Q=0.01, R=0.25, degrees_of_freedom=freedom) for freedom in (None, 4)]
    plain, student = (np.std(kind.run(z, 0, 1).x[:, 0] - x) for kind in kinds)
    clean = np.std(filters.kalman(x + random.normal(0, 0.5, 4000), 1, 1, 0.01, 0.25, 0, 1).x[:, 0] - x)
    assert student < 1.15 * clean and plain > 1.5 * clean
    assert "degrees_of_freedom=4" in repr(kinds[1])
