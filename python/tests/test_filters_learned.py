"""Numbers of a model that are learned from samples: intervals against simulated truth, and two methods against each other."""

from __future__ import annotations

import numpy as np
import pytest

from kalmems import filters

pytest.importorskip("scipy")

F, H = np.array([[1.0, 1.0], [0.0, 0.9]]), np.array([[1.0, 0.0]])
TRUE = {"q": 0.02, "r": 0.5}


def model(q: float, r: float, decay: float = 0.9) -> dict[str, object]:
    return {"F": [[1, 1], [0, decay]], "H": H, "Q": [0, q], "R": r, "x0": [0, 0], "P0": [1, 0.1]}


def measured(seed: int, count: int = 400) -> np.ndarray:
    random = np.random.default_rng(seed)
    x, rows = random.normal(size=2) * np.sqrt([1, 0.1]), []
    for _ in range(count):
        rows.append(x[0] + random.normal(0, TRUE["r"] ** 0.5))
        x = F @ x + np.array([0, random.normal(0, TRUE["q"] ** 0.5)])
    return np.array(rows)


def test_intervals_of_fitted_variances_hold_the_true_ones() -> None:
    """200 simulations; by chance 180 to 199 of each in all but one of a thousand cases."""
    held, by_profile, runs = {"q": 0, "r": 0}, 0, 200
    for seed in range(runs):
        found = filters.fit(model, {"q": 1.0, "r": 1.0}, measured(seed), positive=("q", "r"))
        assert found.converged, (seed, found)
        for name, true in TRUE.items():
            # Of a logarithm, as it was searched.
            held[name] += abs(np.log(found.values[name] / true)) < 1.96 * found.sd[name] / found.values[name]
        if seed < 40:
            low, high = found.interval("q")
            by_profile += low < TRUE["q"] < high
    assert all(180 <= count <= 199 for count in held.values()), held
    assert by_profile >= 33, by_profile


def test_expectation_maximisation_ends_where_the_likelihood_is_largest() -> None:
    z = measured(7, 800)
    z[100:110] = np.nan
    fitted = filters.fit(model, TRUE, z, positive=("q", "r"))
    learned = filters.em(z, F, H, Q=[0, 0.1], R=1, x0=[0, 0], P0=[1, 0.1], tolerance=1e-9, iterations=20_000)
    assert learned.converged and np.all(np.diff(learned.log_likelihood) > -1e-9)
    assert learned.log_likelihood[-1] == pytest.approx(fitted.log_likelihood, abs=1e-3)
    assert learned.Q[1, 1] == pytest.approx(fitted.values["q"], rel=1e-2)
    assert learned.R[0, 0] == pytest.approx(fitted.values["r"], rel=1e-2)
    # What has no noise gets none.
    assert np.abs(learned.Q[0]).max() < 1e-12


def test_learned_covariances_of_several_sensors_are_the_true_ones() -> None:
    """Correlated noises, of which a fifth of the numbers is missing."""
    random = np.random.default_rng(3)
    true = np.array([[0.5, 0.2], [0.2, 0.3]])
    x = np.cumsum(random.normal(0, 0.3, 20_000))
    z = x[:, None] + random.multivariate_normal([0, 0], true, x.size)
    z[random.uniform(size=z.shape) < 0.2] = np.nan
    learned = filters.em(z, F=1, H=[1, 1], Q=1, R=[1, 1], x0=0, P0=10, tolerance=1e-3)
    assert learned.Q[0, 0] == pytest.approx(0.09, rel=0.1)
    assert np.allclose(learned.R, true, atol=0.03)
    diagonal = filters.em(z, F=1, H=[1, 1], Q=1, R=[1, 1], x0=0, P0=10, tolerance=1e-3, diagonal=True)
    assert diagonal.R[0, 1] == 0.0 and diagonal.log_likelihood[-1] < learned.log_likelihood[-1]
    begun = filters.em(z[:50], F=1, H=[1, 1], Q=1, R=[1, 1], x0=0, P0=10, learn=["x0"], iterations=3)
    assert begun.Q[0, 0] == 1.0 and begun.x0[0] != 0.0


def test_a_number_that_the_samples_do_not_determine_has_no_deviation() -> None:
    z = measured(1)
    both = filters.fit(lambda a, b, r: model(0.02, r * a * b), {"a": 1.0, "b": 1.0, "r": 0.5}, z, positive=("a", "b", "r"))
    assert not both.converged and all(np.isinf(sd) for sd in both.sd.values())
    assert both.interval("a") == (0.0, np.inf)


def test_a_parameter_of_the_motion_is_fitted_and_one_too_many_costs() -> None:
    z = measured(5, 3000)
    free = filters.fit(model, {**TRUE, "decay": 0.7}, z, positive=("q", "r"))
    assert abs(free.values["decay"] - 0.9) < 4 * free.sd["decay"] < 0.2
    fixed = filters.fit(model, TRUE, z, positive=("q", "r"))
    assert free.aic == pytest.approx(2 * 3 - 2 * free.log_likelihood)
    assert free.log_likelihood > fixed.log_likelihood - 1e-6
    low, high = free.interval("decay")
    assert low < free.values["decay"] < high and repr(free).startswith("<Fit: q=")


def test_a_model_of_functions_is_fitted() -> None:
    random = np.random.default_rng(4)
    angle = 0.5 * np.cos(0.3 * np.arange(500))
    z = np.sin(angle) + random.normal(0, 0.05, 500)

    def pendulum(rate: float) -> dict[str, object]:
        def f(x: np.ndarray) -> np.ndarray:
            cos, sin = np.cos(rate), np.sin(rate)
            return np.array([cos * x[0] + sin * x[1], cos * x[1] - sin * x[0]])

        return {"f": f, "h": lambda x: np.sin(x[:1]), "Q": [1e-9, 1e-9], "R": 0.05**2, "x0": [0.5, 0], "P0": [0.01, 0.01]}

    found = filters.fit(pendulum, {"rate": 0.301}, z)
    assert abs(found.values["rate"] - 0.3) < 4 * found.sd["rate"] < 1e-3


def test_what_cannot_be_fitted_is_refused_with_its_reason() -> None:
    z = measured(1, 20)
    with pytest.raises(ValueError, match="`positive` names s; `start` has q, r"):
        filters.fit(model, TRUE, z, positive=("s",))
    with pytest.raises(ValueError, match="`start` has q = -1; expected a finite number above 0"):
        filters.fit(model, {"q": -1, "r": 1}, z, positive=("q",))
    with pytest.raises(ValueError, match="`Q` is no covariance"):
        filters.fit(model, {"q": -1, "r": 1}, z)
    with pytest.raises(ValueError, match="`learn` has F; expected some of Q, R, x0"):
        filters.em(z, F, H, [0, 1], 1, [0, 0], [1, 1], learn=["F"])
    with pytest.raises(KeyError, match="no number is called 's'; there are q, r"):
        filters.fit(model, TRUE, z, positive=("q", "r")).interval("s")


def test_a_likelihood_and_its_gradient_serve_other_optimisers() -> None:
    from scipy import optimize

    z = measured(9)
    of = filters.likelihood(model, TRUE, z, positive=("q", "r"))
    at = np.log([0.05, 0.3])
    assert of(at) == pytest.approx(float(filters.kalman(z, **model(0.05, 0.3)).log_likelihood.sum()), abs=1e-9)
    # A step of another size.
    by_five = [(of(at + step) - of(at - step)) / 2e-5 for step in 1e-5 * np.eye(2)]
    assert np.allclose(of.gradient(at), by_five, rtol=1e-4)
    found = optimize.minimize(lambda x: -of(x), at, jac=lambda x: -of.gradient(x), method="L-BFGS-B")
    fitted = filters.fit(model, TRUE, z, positive=("q", "r"))
    assert np.allclose(np.exp(found.x), list(fitted.values.values()), rtol=1e-3)
    assert of([-np.inf, 800.0]) == -np.inf


def of_all(theta: np.ndarray) -> dict[str, object]:
    """A system of two sensors and an input with nine numbers in all its matrices."""
    a, b, c, d, e, f, g, x, p = theta
    return {
        "F": [[1, a], [-0.1, b]],
        "H": [[1, c], [0.3, 1]],
        "Q": [[d, 0.3 * d], [0.3 * d, d]],
        "R": [[e, 0.1 * e], [0.1 * e, f]],
        "B": [[0], [g]],
        "x0": [x, 0],
        "P0": [[p, 0], [0, 1]],
    }


NAMES = tuple("abcdefgxp")
AT = np.array([0.2, 0.9, 0.4, 0.05, 0.3, 0.2, 0.7, 0.5, 0.8])


def by_complex_steps(z: np.ndarray, u: np.ndarray, largest: float) -> np.ndarray:
    """The derivatives of the likelihood of the equations written out, exact to rounding."""
    found = []
    for place in range(AT.size):
        theta = AT.astype(complex)
        theta[place] += 1e-30j
        parts = {name: np.array(value, dtype=complex) for name, value in of_all(theta).items()}
        x, p, total = parts["x0"], parts["P0"], 0.0 + 0.0j
        for k, row in enumerate(z):
            if k > 0:
                x, p = parts["F"] @ x + parts["B"] @ u[k - 1], parts["F"] @ p @ parts["F"].T + parts["Q"]
            there = ~np.isnan(row)
            if there.any():
                h, r = parts["H"][there], parts["R"][np.ix_(there, there)]
                s, left = h @ p @ h.T + r, row[there] - h @ x
                nis = left @ np.linalg.solve(s, left)
                total -= 0.5 * (nis + np.log(np.linalg.det(2 * np.pi * s)))
                if nis.real <= largest:
                    gain = p @ h.T @ np.linalg.inv(s)
                    x, p = x + gain @ left, p - gain @ s @ gain.T
        found.append(total.imag / 1e-30)
    return np.array(found)


@pytest.mark.parametrize("case", ["complete", "missing", "rejected", "singular"])
def test_the_gradient_of_a_linear_model_is_exact(case: str) -> None:
    random = np.random.default_rng(6)
    z, u = random.normal(0, 1, (80, 2)), random.normal(0, 1, (80, 1))
    largest = np.inf
    if case == "missing":
        z[random.uniform(size=z.shape) < 0.3] = np.nan
        z[9] = np.nan
    if case == "rejected":
        z[20, 0], largest = 40.0, 30.0

    def model(**numbers: float) -> dict[str, object]:
        parts = of_all(np.array(list(numbers.values())))
        if case == "singular":
            # A third state that is known exactly, and stays 0.
            parts["F"] = np.pad(np.array(parts["F"]), (0, 1))
            parts |= {name: np.pad(np.array(parts[name]), (0, 1)) for name in ("Q", "P0")}
            parts |= {"H": np.pad(np.array(parts["H"]), ((0, 0), (0, 1))), "B": [*parts["B"], [0]], "x0": [*parts["x0"], 0]}  # type: ignore[misc]
        return {**parts, "largest_nis": None if largest == np.inf else largest}

    of = filters.likelihood(model, dict(zip(NAMES, AT, strict=True)), z, u)
    expected = by_complex_steps(z, u, largest)
    assert np.allclose(of.gradient(AT), expected, rtol=1e-7, atol=1e-7 * np.abs(expected).max())


def test_the_gradient_by_matrices_of_each_sample_is_exact() -> None:
    random = np.random.default_rng(7)
    z, steps = random.normal(0, 1, 40), random.uniform(0.5, 1.5, 40)

    def model(q: float, r: float) -> dict[str, object]:
        motion = np.array([[[1, h], [0, 1]] for h in steps])
        noise = np.array([q * np.array([[h**3 / 3, h**2 / 2], [h**2 / 2, h]]) for h in steps])
        return {"F": motion, "H": H, "Q": noise, "R": r * steps[:, None, None], "x0": [0, 0], "P0": [1, 1]}

    of = filters.likelihood(model, {"q": 0.1, "r": 0.5}, z, positive=("q", "r"))
    at = np.log([0.1, 0.5])
    # Differences of the fourth order, of a function without exact derivatives.
    differences = [
        (8 * (of(at + step) - of(at - step)) - (of(at + 2 * step) - of(at - 2 * step))) / 12e-3 for step in 1e-3 * np.eye(2)
    ]
    assert np.allclose(of.gradient(at), differences, rtol=1e-8)
