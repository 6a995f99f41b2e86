"""The linear Kalman filter and smoother of this package beside those of other libraries: the same model, the same samples, one thread.

    pip install './python[fit]' filterpy pykalman simdkalman statsmodels dynamax numba && python python/benchmarks/libraries.py

Prints the processor's time of each in µs a step, by the fastest of several runs, the root mean square error of the filtered and of the smoothed
position in units of the samples' standard deviation, and by how much its log-likelihood differs from that of this package. Then the variances that
each learns from the samples, and the log-likelihood there. A library that is not installed is named and left out. Times are reported and gate
nothing; that log-likelihoods differ by less than 1e-9 of the largest is asserted.
"""

from __future__ import annotations

import logging
import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from kalmems import filters

COUNT = 20_000
DT, Q, R = 0.1, 1e-3, 0.25
F, H = np.array([[1.0, DT], [-DT, 0.98]]), np.array([[1.0, 0.0]])
NOISE = Q * np.array([[DT**3 / 3, DT**2 / 2], [DT**2 / 2, DT]])
X0, P0 = np.zeros(2), np.eye(2)


@dataclass
class Answer:
    """What a library gives; what it does not give is None."""

    filtered: np.ndarray
    log_likelihood: float | None
    smoothed: np.ndarray | None = None


def simulated() -> tuple[np.ndarray, np.ndarray]:
    random = np.random.default_rng(8)
    steps = random.multivariate_normal([0, 0], NOISE, COUNT)
    states = np.empty((COUNT, 2))
    states[0] = random.multivariate_normal(X0, P0)
    for k in range(1, COUNT):
        states[k] = F @ states[k - 1] + steps[k]
    return states, states[:, 0] + random.normal(0, R**0.5, COUNT)


def by_kalmems(z: np.ndarray) -> Answer:
    found = filters.kalman(z, F, H, NOISE, R, X0, P0, smooth=True)
    assert found.smoothed is not None
    return Answer(found.x, float(found.log_likelihood.sum()), found.smoothed.x)


def by_kalmems_filter(z: np.ndarray) -> Answer:
    found = filters.kalman(z, F, H, NOISE, R, X0, P0)
    return Answer(found.x, float(found.log_likelihood.sum()))


def by_filterpy(z: np.ndarray) -> Answer:
    from filterpy.kalman import KalmanFilter

    kf = KalmanFilter(dim_x=2, dim_z=1)
    kf.x, kf.P, kf.F, kf.H, kf.Q, kf.R = X0.copy(), P0.copy(), F, H, NOISE, np.array([[R]])
    means, covariances, likelihood = np.empty((COUNT, 2)), np.empty((COUNT, 2, 2)), 0.0
    for k in range(COUNT):
        if k > 0:
            kf.predict()
        kf.update(z[k])
        likelihood += kf.log_likelihood
        means[k], covariances[k] = kf.x, kf.P
    smoothed, *_ = kf.rts_smoother(means, covariances)
    return Answer(means, likelihood, smoothed)


def by_pykalman(z: np.ndarray) -> Answer:
    from pykalman import KalmanFilter

    kf = KalmanFilter(F, H, NOISE, np.array([[R]]), initial_state_mean=X0, initial_state_covariance=P0)
    means, _ = kf.filter(z)
    smoothed, _ = kf.smooth(z)
    return Answer(np.asarray(means), float(kf.loglikelihood(z)), np.asarray(smoothed))


def by_simdkalman(z: np.ndarray) -> Answer:
    import simdkalman

    kf = simdkalman.KalmanFilter(state_transition=F, process_noise=NOISE, observation_model=H, observation_noise=R)
    found = kf.compute(z, 0, initial_value=X0, initial_covariance=P0, filtered=True, smoothed=True, log_likelihood=True)
    # It leaves out ln 2π/2 of each sample.
    likelihood = float(np.sum(found.log_likelihood)) - 0.5 * COUNT * np.log(2 * np.pi)
    return Answer(found.filtered.states.mean, likelihood, found.smoothed.states.mean)


def by_statsmodels(z: np.ndarray) -> Answer:
    from statsmodels.tsa.statespace.kalman_smoother import KalmanSmoother

    kf = KalmanSmoother(k_endog=1, k_states=2, initialization="known", initial_state=X0, initial_state_cov=P0)
    kf.bind(z)
    # Without the gain that it takes for settled once the covariance changes little.
    kf.tolerance = 0
    kf["transition"], kf["design"], kf["state_cov"], kf["obs_cov"], kf["selection"] = F, H, NOISE, np.array([[R]]), np.eye(2)
    found = kf.smooth()
    return Answer(found.filtered_state.T, float(found.llf), found.smoothed_state.T)


def of_dynamax() -> Callable[[np.ndarray], Answer]:
    """Compiled by JAX before it is timed."""
    import jax

    jax.config.update("jax_enable_x64", True)
    from dynamax.linear_gaussian_ssm.inference import lgssm_smoother, make_lgssm_params

    parameters = make_lgssm_params(X0, P0, F, NOISE, H, np.array([[R]]))
    smooth = jax.jit(lambda z: lgssm_smoother(parameters, z))

    def answer(z: np.ndarray) -> Answer:
        found = smooth(z[:, None])
        return Answer(np.asarray(found.filtered_means), float(found.marginal_loglik), np.asarray(found.smoothed_means))

    answer(simulated()[1])
    return answer


def hand_written() -> Callable[[np.ndarray], Answer]:
    """The filter of two states and one measurement, unrolled by hand for Numba."""
    import numba

    @numba.njit(cache=False)
    def run(z, f, q, r, x, p):
        count = len(z)
        means, covariances, innovations = np.empty((count, 2)), np.empty((count, 2, 2)), np.empty((count, 1))
        s_all, nis, likelihoods = np.empty((count, 1, 1)), np.empty(count), np.empty(count)
        a, b, p00, p01, p11 = x[0], x[1], p[0, 0], p[0, 1], p[1, 1]
        for k in range(count):
            if k > 0:
                a, b = f[0, 0] * a + f[0, 1] * b, f[1, 0] * a + f[1, 1] * b
                g00, g01 = f[0, 0] * p00 + f[0, 1] * p01, f[0, 0] * p01 + f[0, 1] * p11
                g10, g11 = f[1, 0] * p00 + f[1, 1] * p01, f[1, 0] * p01 + f[1, 1] * p11
                p00 = g00 * f[0, 0] + g01 * f[0, 1] + q[0, 0]
                p01 = g00 * f[1, 0] + g01 * f[1, 1] + q[0, 1]
                p11 = g10 * f[1, 0] + g11 * f[1, 1] + q[1, 1]
            s, left = p00 + r, z[k] - a
            k0, k1 = p00 / s, p01 / s
            a, b = a + k0 * left, b + k1 * left
            p11 -= k1 * p01
            p00, p01 = p00 - k0 * p00, p01 - k0 * p01
            means[k, 0], means[k, 1] = a, b
            covariances[k, 0, 0], covariances[k, 0, 1], covariances[k, 1, 0], covariances[k, 1, 1] = p00, p01, p01, p11
            innovations[k, 0], s_all[k, 0, 0], nis[k] = left, s, left * left / s
            likelihoods[k] = -0.5 * (nis[k] + np.log(2 * np.pi * s))
        return means, covariances, innovations, s_all, nis, likelihoods

    def answer(z: np.ndarray) -> Answer:
        means, *_, likelihoods = run(z, F, NOISE, R, X0, P0)
        return Answer(means, float(likelihoods.sum()))

    answer(simulated()[1][:10])
    return answer


LIBRARIES: list[tuple[str, int, Callable[[], Callable[[np.ndarray], Answer]]]] = [
    ("kalmems.filters.kalman", 20, lambda: by_kalmems_filter),
    ("by hand, unrolled, compiled by Numba", 20, hand_written),
    ("kalmems.filters.kalman and smoother", 10, lambda: by_kalmems),
    ("statsmodels, filter and smoother", 10, lambda: by_statsmodels),
    ("dynamax, filter and smoother", 10, of_dynamax),
    ("simdkalman, filter and smoother", 1, lambda: by_simdkalman),
    ("filterpy, filter and smoother", 1, lambda: by_filterpy),
    ("pykalman, filter and smoother", 1, lambda: by_pykalman),
]


def timed(runs: int, work: Callable[[], Answer]) -> tuple[float, Answer]:
    best = np.inf
    for _ in range(runs):
        begun = time.process_time()
        found = work()
        best = min(best, time.process_time() - begun)
    return best, found


def learned(z: np.ndarray) -> None:
    """The variance of the samples and the size of the process noise, by this package's two ways and by pykalman's."""

    def model(q: float, r: float) -> dict[str, object]:
        return {"F": F, "H": H, "Q": q / Q * NOISE, "R": r, "x0": X0, "P0": P0}

    def likelihood(q: np.ndarray, r: float) -> float:
        return float(filters.kalman(z, F, H, q, r, X0, P0).log_likelihood.sum())

    print(f"\n{'learned from wrong variances (q × 10, r × 4)':44} {'seconds':>8}  {'q, true 0.001':>13}  {'r, true 0.25':>12}  {'log-likelihood':>14}")
    begun = time.process_time()
    found = filters.fit(model, {"q": 10 * Q, "r": 4 * R}, z, positive=("q", "r"))
    print(f"{'kalmems.filters.fit':44} {time.process_time() - begun:8.2f}  {found.values['q']:13.6f}  {found.values['r']:12.6f}  {found.log_likelihood:14.4f}")
    begun = time.process_time()
    own = filters.em(z, F, H, 10 * NOISE, 4 * R, X0, P0, iterations=5)
    print(f"{'kalmems.filters.em, 5 iterations, all of Q':44} {time.process_time() - begun:8.2f}  {own.Q[1, 1] / DT:13.6f}  {own.R[0, 0]:12.6f}  {own.log_likelihood[-1]:14.4f}")
    try:
        from pykalman import KalmanFilter
    except ImportError:
        return
    begun = time.process_time()
    learns = ["transition_covariance", "observation_covariance"]
    kf = KalmanFilter(F, H, 10 * NOISE, np.array([[4 * R]]), initial_state_mean=X0, initial_state_covariance=P0, em_vars=learns)
    kf = kf.em(z, n_iter=5)
    q, r = np.asarray(kf.transition_covariance), float(np.asarray(kf.observation_covariance)[0, 0])
    # Symmetric to rounding.
    q = 0.5 * (q + q.T)
    print(f"{'pykalman, 5 iterations, all of Q':44} {time.process_time() - begun:8.2f}  {q[1, 1] / DT:13.6f}  {r:12.6f}  {likelihood(q, r):14.4f}")
    print(f"largest difference of the two in Q and R: {max(np.abs(q - own.Q).max(), abs(r - own.R[0, 0])):.1e}")


def main() -> None:
    logging.disable()
    warnings.simplefilter("ignore")
    states, z = simulated()
    reference = by_kalmems(z)
    assert reference.log_likelihood is not None
    print(f"{'':44} {'µs a step':>9}  {'filtered':>8}  {'smoothed':>8}  {'log-likelihood, difference':>26}")
    for name, runs, prepared in LIBRARIES:
        try:
            work = prepared()
            seconds, found = timed(runs, lambda work=work: work(z))
        except ImportError as error:
            print(f"{name:44} {error.name} is not installed")
            continue

        def rmse(means: np.ndarray | None) -> str:
            return "" if means is None else f"{np.sqrt(np.mean((means[:, 0] - states[:, 0]) ** 2) / R):.5f}"

        apart = np.nan if found.log_likelihood is None else found.log_likelihood - reference.log_likelihood
        print(f"{name:44} {1e6 * seconds / COUNT:9.3f}  {rmse(found.filtered):>8}  {rmse(found.smoothed):>8}  {apart:26.1e}")
        assert not abs(apart) > 1e-9 * abs(reference.log_likelihood), name
    learned(z)


if __name__ == "__main__":
    main()
