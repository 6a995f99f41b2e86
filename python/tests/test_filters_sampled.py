"""Filters of many states and of several models, against the filters that are exact where there is one."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from test_filters_general import by_hand, samples, seen, system

from kalmems import filters


def of_functions(parts: dict[str, np.ndarray]) -> dict[str, Any]:
    return {"f": lambda x: parts["F"] @ x, "h": lambda x: parts["H"] @ x, "Q": parts["Q"], "R": parts["R"]}


@pytest.mark.parametrize("kind", ["ensemble", "bootstrap", "auxiliary"])
def test_filters_of_many_states_come_to_the_kalman_filter_of_a_linear_system(kind: str) -> None:
    parts = system(2, 2)
    # Of samples with less noise the auxiliary one's weights are so uneven that it needs many more particles.
    parts["R"] *= 10
    _, z = samples(parts, 60)
    z[10] = np.nan
    z[20, 1] = np.nan
    exact = by_hand(z, parts)
    model, members = of_functions(parts), 20_000
    if kind == "ensemble":
        one: filters.Ensemble | filters.Particles = filters.Ensemble(**model, members=members, seed=3)
    else:
        one = filters.Particles(**model, members=members, auxiliary=kind == "auxiliary", seed=3)
    found = one.run(z, parts["x0"], parts["P0"])
    sd = np.sqrt(np.diagonal(exact["P"], axis1=1, axis2=2))
    assert np.sqrt(np.mean(((found.x - exact["x"]) / sd) ** 2)) < 0.05
    assert np.mean(found.sd / sd) == pytest.approx(1, abs=0.03)
    assert np.nansum(found.log_likelihood) == pytest.approx(np.nansum(exact["log_likelihood"]), abs=1.5)
    assert np.isnan(found.nis[10]) and np.isnan(found.innovation[20, 1]) and not np.isnan(found.innovation[20, 0])
    again = type(one)(**model, members=members, seed=3, **({"auxiliary": True} if kind == "auxiliary" else {}))
    assert np.array_equal(again.run(z, parts["x0"], parts["P0"]).x, found.x)


def test_functions_are_called_once_for_all_states_where_that_gives_the_same() -> None:
    calls = []

    def together(x: np.ndarray) -> np.ndarray:
        calls.append(np.ndim(x))
        return np.array([x[0] + 0.1 * x[1], x[1]])

    def alone(x: np.ndarray) -> list[float]:
        return [float(x[0]), x.sum()]

    noise = {"Q": 1e-4 * np.eye(2), "R": [1e-2, 4e-4], "members": 50}
    filters.Particles(together, seen, **noise).run([[3.6, 0.6]] * 5, [3, 2], [0.1, 0.1])
    assert calls[-4:] == [2, 2, 2, 2]
    filters.Ensemble(alone, seen, **noise).run([[3.6, 0.6]] * 3, [3, 2], [0.1, 0.1])
    with pytest.raises(ValueError, match=r"`f` gives an array of the shape \(3,\); expected \(2,\)"):
        filters.Particles(lambda x: [x[0], x[0], x[1]], seen, **noise).run([[3.6, 0.6]], [3, 2], [0.1, 0.1])
    with pytest.raises(ArithmeticError, match="stops at sample 0: no particle explains it"):
        filters.Particles(together, seen, **noise).run([[1e200, 0.6]], [3, 2], [0.1, 0.1])


def test_particles_keep_both_signs_where_the_kalman_filters_take_one() -> None:
    z = 1 + 0.1 * np.random.default_rng(5).normal(size=30)
    found = filters.Particles(lambda x: x, lambda x: x**2, Q=1e-4, R=0.01, members=5000).run(z, 0.1, 1.0)
    assert found.sd[-1, 0] == pytest.approx(1, abs=0.1) and abs(found.x[-1, 0]) < 0.5


def test_of_one_model_interacting_ones_are_the_kalman_filter() -> None:
    parts = system(3, 2)
    _, z = samples(parts, 40)
    z[7, 0] = np.nan
    exact = by_hand(z, parts)
    matrices = {name: parts[name] for name in "FHQR"}
    for models, switching in (([matrices], [[1.0]]), ([matrices, matrices], [[0.9, 0.1], [0.3, 0.7]])):
        found = filters.interacting(z, models, switching, parts["x0"], parts["P0"])
        assert np.allclose(found.x, exact["x"], atol=1e-10) and np.allclose(found.P, exact["P"], atol=1e-10)
        assert np.nansum(found.log_likelihood) == pytest.approx(np.nansum(exact["log_likelihood"]), rel=1e-10)
        assert found.models is not None and np.allclose(found.models.sum(axis=1), 1)


def test_of_models_that_never_switch_the_true_one_is_found_by_bayes_rule() -> None:
    quiet, loud = system(1, 1), system(1, 1)
    loud = {**quiet, "R": 9 * quiet["R"]}
    _, z = samples(loud, 30)
    apart = [by_hand(z, one)["log_likelihood"].sum() for one in (quiet, loud)]
    matrices = [{name: one[name] for name in "FHQR"} for one in (quiet, loud)]
    found = filters.interacting(z, matrices, np.eye(2), quiet["x0"], quiet["P0"])
    assert found.models is not None
    assert found.models[-1, 1] == pytest.approx(1 / (1 + np.exp(apart[0] - apart[1])), rel=1e-9)
    for wrong, why in (([[1.0, 0.1], [0, 1]], "`switching` has the shape"), (np.eye(3), r"expected \(2, 2\)")):
        with pytest.raises(ValueError, match=why):
            filters.interacting(z, matrices, wrong, quiet["x0"], quiet["P0"])
    with pytest.raises(ValueError, match="`chances` has the shape"):
        filters.interacting(z, matrices, np.eye(2), quiet["x0"], quiet["P0"], chances=[0.5, 0.6])


def test_drawn_ways_have_the_moments_of_the_smoother_and_go_on_as_the_system_does() -> None:
    parts, draws = system(2, 1), 20_000
    _, z = samples(parts, 25)
    z[20:] = np.nan
    smoothed = filters.kalman(z, **parts, smooth=True).smoothed
    assert smoothed is not None
    ways = filters.posterior(z, **parts, draws=draws, seed=2)
    error = (ways.mean(axis=0) - smoothed.x) / smoothed.sd
    assert np.abs(error).max() < 5 / draws**0.5
    assert np.allclose(ways.std(axis=0) / smoothed.sd, 1, atol=0.03)
    # Behind the last sample a step of each way has the noise of the process.
    steps = ways[:, 23] - ways[:, 22] @ parts["F"].T
    assert np.allclose(np.cov(steps.T), parts["Q"], rtol=0.06, atol=0.02 * parts["Q"].max())


@pytest.mark.parametrize("kind", ["ensemble", "bootstrap", "auxiliary"])
@pytest.mark.parametrize("smooth", [True, 4])
def test_smoothers_of_many_states_come_to_those_of_a_linear_system(kind: str, smooth: bool | int) -> None:
    parts = system(2, 2)
    parts["R"] *= 10
    _, z = samples(parts, 40)
    z[10] = np.nan
    z[20, 1] = np.nan
    exact = filters.kalman(z, **parts, smooth=smooth).smoothed
    filtered = filters.kalman(z, **parts)
    model, members = of_functions(parts), 20_000 if smooth is not True or kind == "ensemble" else 8000
    if kind == "ensemble":
        one: filters.Ensemble | filters.Particles = filters.Ensemble(**model, members=members, seed=3)
    else:
        one = filters.Particles(**model, members=members, auxiliary=kind == "auxiliary", seed=3)
    found = one.run(z, parts["x0"], parts["P0"], smooth=smooth).smoothed
    assert found is not None and exact is not None
    # Of 500 drawn ways a mean has a standard error of 0.045 standard deviations.
    limit = 0.05 if members == 20_000 else 0.12
    assert np.sqrt(np.mean(((found.x - exact.x) / exact.sd) ** 2)) < limit
    assert np.mean(found.sd / exact.sd) == pytest.approx(1, abs=0.05)
    # It is not the filter's answer.
    assert np.sqrt(np.mean(((filtered.x - exact.x) / exact.sd) ** 2)) > limit


def test_of_equal_models_interacting_ones_are_the_smoother() -> None:
    parts = system(3, 2)
    _, z = samples(parts, 30)
    z[7, 0] = np.nan
    matrices = {name: parts[name] for name in "FHQR"}
    for smooth in (True, 5):
        exact = filters.kalman(z, **parts, smooth=smooth).smoothed
        found = filters.interacting(z, [matrices, matrices], [[0.9, 0.1], [0.3, 0.7]], parts["x0"], parts["P0"], smooth=smooth).smoothed
        assert found is not None and exact is not None
        assert np.allclose(found.x, exact.x, atol=1e-9) and np.allclose(found.P, exact.P, atol=1e-9)


def test_of_models_that_never_switch_the_smoother_is_that_of_the_true_one() -> None:
    quiet = system(2, 1)
    loud = {**quiet, "Q": 400 * quiet["Q"]}
    _, z = samples(loud, 200)
    matrices = [{name: one[name] for name in "FHQR"} for one in (quiet, loud)]
    found = filters.interacting(z, matrices, np.eye(2), quiet["x0"], quiet["P0"], smooth=True)
    exact = filters.kalman(z, **loud, smooth=True).smoothed
    assert found.models is not None and found.models[-1, 1] > 1 - 1e-12
    assert found.smoothed is not None and exact is not None and np.allclose(found.smoothed.x, exact.x, atol=1e-6)


def test_particles_are_smoothed_by_all_samples_with_a_definite_noise_alone() -> None:
    model = filters.Particles(lambda x: x, lambda x: x[:1], Q=[1, 0], R=1, members=50)
    with pytest.raises(ValueError, match="only if `Q` is definite; give a number of later samples"):
        model.run([0.0, 1.0], [0, 0], [1, 1], smooth=True)
    assert len(model.run([0.0, 1.0], [0, 0], [1, 1], smooth=1).smoothed or ()) == 2
