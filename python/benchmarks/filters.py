"""Kalman filters of this package beside filterpy: the same models, the same samples, one thread.

    pip install ./python filterpy numba && python python/benchmarks/filters.py

Prints the processor's time of each, of all its threads together, in µs a step, by the fastest of several runs, how many times filterpy takes it, and the
root mean square error of the scanner's angle. The estimate with verdict reads the experiment, finds out what is wrong with the recording, filters and tests the innovations, which show in
this example that a number is wrong: the numbers are not checked one by one. Times are reported and gate nothing.
"""

from __future__ import annotations

import csv
import time
import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np

import kalmems
from kalmems import filters

EXAMPLE = Path(__file__).resolve().parents[2] / "examples/shared_scanner"

# The scanner as the example describes it, in SI.
J, B, K = 1.15e-14, 5.95e-12, 1.1033e-4
C0, WIDTH, CB = 5.71e-12, 0.2, 9.79e-12
GAIN, OFFSET, R = -0.3574e12, 6.3945, 1.92e-4
CARRIER = 18.0
DT = 1e-6
Q = 1e8 * np.array([[DT**3 / 3, DT**2 / 2], [DT**2 / 2, DT]])
X0, P0 = np.array([0.05, 0.0]), np.diag([0.15**2, 15e3**2])


def read(name: str) -> dict[str, np.ndarray]:
    with (EXAMPLE / name).open(newline="", encoding="utf-8") as lines:
        names, *rows = list(csv.reader(lines))
    return {name: np.array([float(row[place]) for row in rows]) for place, name in enumerate(names)}


def rate(x: np.ndarray, volts: float) -> np.ndarray:
    slope = -2 * C0 / WIDTH**2 * x[0] * np.exp(-((x[0] / WIDTH) ** 2))
    return np.array([x[1], (0.5 * slope * (volts**2 + CARRIER) - B * x[1] - K * x[0]) / J])


def rate_slope(x: np.ndarray, volts: float) -> np.ndarray:
    a = (x[0] / WIDTH) ** 2
    curvature = (4 * a - 2) / WIDTH**2 * C0 * np.exp(-a)
    return np.array([[0.0, 1.0], [(0.5 * curvature * (volts**2 + CARRIER) - K) / J, -B / J]])


def move(x: np.ndarray, u: np.ndarray) -> np.ndarray:
    """A step by Runge and Kutta, with the drive at its beginning, its middle and its end."""
    k1 = rate(x, u[0])
    k2 = rate(x + 0.5 * DT * k1, u[1])
    k3 = rate(x + 0.5 * DT * k2, u[1])
    k4 = rate(x + DT * k3, u[2])
    return x + DT / 6 * (k1 + 2 * k2 + 2 * k3 + k4)


def move_slope(x: np.ndarray, u: np.ndarray) -> np.ndarray:
    one = np.eye(2)
    k1 = rate(x, u[0])
    k2 = rate(x + 0.5 * DT * k1, u[1])
    k3 = rate(x + 0.5 * DT * k2, u[1])
    f1 = rate_slope(x, u[0])
    f2 = rate_slope(x + 0.5 * DT * k1, u[1]) @ (one + 0.5 * DT * f1)
    f3 = rate_slope(x + 0.5 * DT * k2, u[1]) @ (one + 0.5 * DT * f2)
    f4 = rate_slope(x + DT * k3, u[2]) @ (one + DT * f3)
    return one + DT / 6 * (f1 + 2 * f2 + 2 * f3 + f4)


def see(x: np.ndarray, *_: object) -> np.ndarray:
    return np.array([GAIN * (C0 * np.exp(-((x[0] / WIDTH) ** 2)) + CB) + OFFSET])


def see_slope(x: np.ndarray, *_: object) -> np.ndarray:
    return np.array([[GAIN * -2 * C0 / WIDTH**2 * x[0] * np.exp(-((x[0] / WIDTH) ** 2)), 0.0]])


def fastest(runs: int, work: Callable[[], object]) -> tuple[float, object]:
    best, found = np.inf, None
    for _ in range(runs):
        begun = time.process_time()
        found = work()
        best = min(best, time.process_time() - begun)
    return best, found


def by_filterpy(z: np.ndarray, u: np.ndarray) -> np.ndarray:
    from filterpy.kalman import ExtendedKalmanFilter

    ekf = ExtendedKalmanFilter(dim_x=2, dim_z=1)
    ekf.x, ekf.P, ekf.Q, ekf.R = X0.copy(), P0.copy(), Q, np.array([[R]])
    angles = np.empty(len(z))
    for k in range(len(z)):
        if k > 0:
            ekf.F = move_slope(ekf.x, u[k - 1])
            ekf.x = move(ekf.x, u[k - 1])
            ekf.P = ekf.F @ ekf.P @ ekf.F.T + ekf.Q
        ekf.update(z[k : k + 1], see_slope, see)
        angles[k] = ekf.x[0]
    return angles


def for_numba() -> dict[str, Callable[..., None]]:
    """The same model as functions that Numba compiles."""
    import numba

    @numba.njit(inline="always")
    def acceleration(angle, omega, volts):
        slope = -2 * C0 / WIDTH**2 * angle * np.exp(-((angle / WIDTH) ** 2))
        return (0.5 * slope * (volts**2 + CARRIER) - B * omega - K * angle) / J

    @numba.njit(inline="always")
    def stiffness(angle, volts):
        a = (angle / WIDTH) ** 2
        return (0.5 * ((4 * a - 2) / WIDTH**2 * C0 * np.exp(-a)) * (volts**2 + CARRIER) - K) / J

    def f(x, u, out):
        a, w, h = x[0], x[1], 0.5 * DT
        a1, w1 = w, acceleration(a, w, u[0])
        a2, w2 = w + h * w1, acceleration(a + h * a1, w + h * w1, u[1])
        a3, w3 = w + h * w2, acceleration(a + h * a2, w + h * w2, u[1])
        a4, w4 = w + DT * w3, acceleration(a + DT * a3, w + DT * w3, u[2])
        out[0] = a + DT / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
        out[1] = w + DT / 6 * (w1 + 2 * w2 + 2 * w3 + w4)

    def fx(x, u, out):
        a, w, h, d = x[0], x[1], 0.5 * DT, -B / J
        w1 = acceleration(a, w, u[0])
        a2 = w + h * w1
        w2 = acceleration(a + h * w, w + h * w1, u[1])
        a3 = w + h * w2
        angles = (a, a + h * w, a + h * a2, a + DT * a3)
        for j in range(2):
            ya, yw = (1.0, 0.0) if j == 0 else (0.0, 1.0)
            ka, kw, suma, sumw = 0.0, 0.0, 0.0, 0.0
            for stage in range(4):
                reach = 0.0 if stage == 0 else (DT if stage == 3 else h)
                da, dw = ya + reach * ka, yw + reach * kw
                volts = u[0] if stage == 0 else (u[2] if stage == 3 else u[1])
                ka, kw = dw, stiffness(angles[stage], volts) * da + d * dw
                weight = 1.0 if stage in (0, 3) else 2.0
                suma += weight * ka
                sumw += weight * kw
            out[j] = ya + DT / 6 * suma
            out[2 + j] = yw + DT / 6 * sumw

    def h(x, u, out):
        out[0] = GAIN * (C0 * np.exp(-((x[0] / WIDTH) ** 2)) + CB) + OFFSET

    def hx(x, u, out):
        out[0] = GAIN * -2 * C0 / WIDTH**2 * x[0] * np.exp(-((x[0] / WIDTH) ** 2))
        out[1] = 0.0

    return {"f": f, "F": fx, "h": h, "H": hx}


def compiled() -> dict[str, object]:
    """The model as functions of C."""
    import numba

    as_c = numba.cfunc("void(CPointer(float64), CPointer(float64), CPointer(float64))")
    return {name: as_c(function) for name, function in for_numba().items()}


def by_hand() -> Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, ...]]:
    """The filter of this model, unrolled by hand for Numba: it gives what `Ekf` gives."""
    import numba

    f, fx, h, hx = (numba.njit(function) for function in for_numba().values())

    @numba.njit
    def run(z, u):
        rows = len(z)
        means, covariances, others = np.empty((rows, 2)), np.empty((rows, 2, 2)), np.empty((4, rows))
        x, ahead, motion, seen, sensor = X0.copy(), np.empty(2), np.empty(4), np.empty(1), np.empty(2)
        a, b, c = P0[0, 0], P0[0, 1], P0[1, 1]
        for k in range(rows):
            if k > 0:
                f(x, u[k - 1], ahead)
                fx(x, u[k - 1], motion)
                x[0], x[1] = ahead[0], ahead[1]
                d, e = motion[0] * a + motion[1] * b, motion[0] * b + motion[1] * c
                g, i = motion[2] * a + motion[3] * b, motion[2] * b + motion[3] * c
                a, b, c = d * motion[0] + e * motion[1] + Q[0, 0], d * motion[2] + e * motion[3] + Q[0, 1], g * motion[2] + i * motion[3] + Q[1, 1]
            h(x, u[k], seen)
            hx(x, u[k], sensor)
            d, e = a * sensor[0] + b * sensor[1], b * sensor[0] + c * sensor[1]
            v, s = z[k] - seen[0], d * sensor[0] + e * sensor[1] + R
            x[0] += d / s * v
            x[1] += e / s * v
            a, b, c = a - d * d / s, b - d * e / s, c - e * e / s
            means[k, 0], means[k, 1] = x[0], x[1]
            covariances[k, 0, 0], covariances[k, 0, 1], covariances[k, 1, 0], covariances[k, 1, 1] = a, b, b, c
            others[0, k], others[1, k], others[2, k], others[3, k] = v, s, v * v / s, -0.5 * (v * v / s + np.log(2 * np.pi * s))
        return means, covariances, others

    return run


def main() -> None:
    recorded, truth = read("recording.csv"), read("reference.csv")
    z, drive = recorded["cap_V"], recorded["drive_V"]
    # The drive between two samples, by the cubic through the four around.
    padded = np.concatenate([[3 * drive[0] - 3 * drive[1] + drive[2]], drive, [3 * drive[-1] - 3 * drive[-2] + drive[-3]] * 2])
    middle = (-padded[:-3] + 9 * padded[1:-2] + 9 * padded[2:-1] - padded[3:]) / 16
    u = np.stack([drive, middle[: len(drive)], np.append(drive[1:], drive[-1])], axis=1)
    rows, scored = len(z), recorded["time_s"] >= recorded["time_s"][0] + 8e-3

    def rmse(angle: np.ndarray) -> float:
        # The sign cannot be seen in this signal.
        errors = [np.sqrt(np.mean((sign * angle - truth["angle_rad"])[scored] ** 2)) for sign in (1, -1)]
        return float(np.degrees(min(errors)))

    rows_of_table: list[tuple[str, float, object]] = []

    def line(what: str, seconds: float, angle: np.ndarray | None) -> None:
        error = "" if angle is None else f"{rmse(angle):.4f}"
        rows_of_table.append((what, 1e6 * seconds / rows, error))

    text = kalmems.Experiment.load(EXAMPLE / "experiment.toml").to_dict()
    text["estimate"]["filter"] = [one for one in text["estimate"]["filter"] if one["name"] == "EKF"]
    compared = kalmems.Experiment.from_dict(text, EXAMPLE / "experiment.toml")
    experiment = compared.replace({"recording[0].reference": None})
    recording = kalmems.Recording(recorded)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        seconds, result = fastest(20, lambda: experiment.estimate(recording))
        with_reference, _ = fastest(20, lambda: compared.estimate(recording, reference=kalmems.Recording(truth)))
    ekf = result["EKF"]
    line("scanner's EKF, filter alone", ekf.seconds_per_step * rows, ekf.angle)
    line("scanner's EKF, estimate from arrays with verdict", seconds, ekf.angle)
    line("the same, compared with a reference as well", with_reference, ekf.angle)
    other: float | None = None
    noise = {"Q": Q, "R": [[R]]}
    python = filters.Ekf(f=move, h=see, F=move_slope, H=see_slope, **noise)
    seconds, found = fastest(3, lambda: python.run(z, X0, P0, u))
    line("kalmems.filters.Ekf, model in Python", seconds, found.x[:, 0])
    try:
        native = filters.Ekf(**compiled(), **noise)
        seconds, found = fastest(20, lambda: native.run(z, X0, P0, u))
        line("kalmems.filters.Ekf, model compiled by Numba", seconds, found.x[:, 0])
        unrolled = by_hand()
        seconds, (means, _, others) = fastest(20, lambda: unrolled(z, u))
        line("the same filter by hand, unrolled, compiled by Numba", seconds, means[:, 0])
        difference = abs(others[3].sum() / found.log_likelihood.sum() - 1)
        print(f"relative difference of the two log-likelihoods: {difference:.1e}")
        assert difference < 1e-9
    except ImportError:
        print("Numba is not installed")
    try:
        seconds, angle = fastest(3, lambda: by_filterpy(z, u))
        other = 1e6 * seconds / rows
        line("filterpy.ExtendedKalmanFilter, the same model", seconds, angle)
    except ImportError:
        print("filterpy is not installed")

    print(f"{'':58} {'µs a step':>9}  {'RMSE (°)':>9}  {'filterpy takes':>15}")
    for what, each, error in rows_of_table:
        times = "" if other is None or what.startswith("filterpy") else f"{other / each:.0f} times that"
        print(f"{what:58} {each:9.3f}  {error:>9}  {times:>15}")
    rows_of_table.clear()

    f, h, q = np.array([[1.0, DT], [-1e10 * DT, 1.0]]), np.array([[1.0, 0.0]]), Q
    seconds, own = fastest(20, lambda: filters.kalman(z, f, h, q, [[R]], X0, P0))
    line("kalmems.filters.kalman, linear", seconds, None)
    try:
        from filterpy.kalman import KalmanFilter

        def linear() -> np.ndarray:
            other = KalmanFilter(dim_x=2, dim_z=1)
            other.x, other.P, other.F, other.H, other.Q, other.R = X0.copy(), P0.copy(), f, h, q, np.array([[R]])
            means = np.empty((rows, 2))
            for k in range(rows):
                if k > 0:
                    other.predict()
                other.update(z[k])
                means[k] = other.x
            return means

        seconds, means = fastest(3, linear)
        line("filterpy.KalmanFilter, the same system", seconds, None)
        for what, each, _ in rows_of_table:
            print(f"{what:58} {each:9.3f}")
        print(f"largest difference of the two in the first state: {np.max(np.abs(means[:, 0] - own.x[:, 0])):.1e}")
    except ImportError:
        pass


if __name__ == "__main__":
    main()
