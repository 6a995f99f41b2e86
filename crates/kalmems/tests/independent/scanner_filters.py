"""Extended Kalman filters of the shared-electrode scanner that share no code with this project, with a converged step.

    KALMEMS_REFERENCE_DATA=… python3 scanner_filters.py > scanner_filters.json      (NumPy, Numba, SciPy)

The expected values of the reference recording were reached by one step of Runge and Kutta's method a sample and a drive
between samples from four points. At small process noises that step alone changes the smoothed phase by a tenth. Here the
same filters take eight steps a sample and a drive from eight points: twice as many change no digit that is written.
With the arguments `1 4` the program gives the expected values of the recording.
"""

import json
import os
import sys

import numba as nb
import numpy as np

FOLDER = os.path.join(os.environ["KALMEMS_REFERENCE_DATA"], "recordings", "shared-scanner")
with open(os.path.join(FOLDER, "device.json")) as file:
    DEVICE = json.load(file)
INERTIA, STIFFNESS, DAMPING, WIDTH, COMB, BIAS, GAIN, OFFSET, VARIANCE = (
    DEVICE["model_" + name]
    for name in (
        "inertia_kg_m2",
        "stiffness_N_m_per_rad",
        "damping_N_m_s_per_rad",
        "gaussian_width_rad",
        "gaussian_capacitance_F",
        "bias_capacitance_F",
        "circuit_gain_V_per_F",
        "circuit_offset_V",
        "noise_variance_V2",
    )
)
CARRIER = DEVICE["carrier_mean_square_V2"]
INTERVAL = 1 / DEVICE["sample_rate_Hz"]
MOTION_HZ = DEVICE["motion_frequency_Hz"]
SKIP = 8e-3
# Angle, rate, relative deviations of stiffness and gain, offset.
START = np.array([0.05, 0.0, 0.0, 0.0, 0.0])
START_SD = np.array([0.15, 15e3, 0.01, 0.05, 0.05])
DRIFT = np.array([0.0, 0.0, 1e-7, 1e-8, 1e-8])


@nb.njit
def rate(x, volts):
    comb = COMB * np.exp(-((x[0] / WIDTH) ** 2))
    square = volts**2 + CARRIER
    first = -2 * x[0] / WIDTH**2 * comb
    second = (4 * x[0] ** 2 / WIDTH**4 - 2 / WIDTH**2) * comb
    f = np.zeros(5)
    f[0] = x[1]
    f[1] = (0.5 * first * square - DAMPING * x[1] - STIFFNESS * (1 + x[2]) * x[0]) / INERTIA
    jacobian = np.zeros((5, 5))
    jacobian[0, 1] = 1
    jacobian[1, 0] = (0.5 * second * square - STIFFNESS * (1 + x[2])) / INERTIA
    jacobian[1, 1] = -DAMPING / INERTIA
    jacobian[1, 2] = -STIFFNESS * x[0] / INERTIA
    return f, jacobian


@nb.njit
def drive_at(drive, sample, part, points):
    first = max(0, min(sample - points // 2 + 1, len(drive) - points))
    value = 0.0
    for a in range(points):
        weight = 1.0
        for b in range(points):
            if b != a:
                weight *= (sample + part - first - b) / (a - b)
        value += weight * drive[first + a]
    return value


@nb.njit
def over_a_sample(x, drive, sample, steps, points):
    one = np.eye(5)
    transition = np.eye(5)
    h = INTERVAL / steps
    for j in range(steps):
        begin, middle, end = (
            drive_at(drive, sample, j / steps, points),
            drive_at(drive, sample, (j + 0.5) / steps, points),
            drive_at(drive, sample, (j + 1) / steps, points),
        )
        k1, a1 = rate(x, begin)
        k2, a2 = rate(x + h / 2 * k1, middle)
        s2 = a2 @ (one + h / 2 * a1)
        k3, a3 = rate(x + h / 2 * k2, middle)
        s3 = a3 @ (one + h / 2 * s2)
        k4, a4 = rate(x + h * k3, end)
        s4 = a4 @ (one + h * s3)
        x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        transition = (one + h / 6 * (a1 + 2 * s2 + 2 * s3 + s4)) @ transition
    return x, transition


@nb.njit
def process_noise(x, volts, density, free):
    """∫ Φ(s) q Φ(s)ᵀ ds over one sample by Gauss's rule of three points."""
    jacobian = rate(x, volts)[1]
    noise = np.diag(DRIFT * free * INTERVAL)
    for node, weight in ((-(0.6**0.5), 5 / 18), (0.0, 8 / 18), (0.6**0.5, 5 / 18)):
        a = jacobian * (INTERVAL * (1 + node) / 2)
        column = (np.eye(5) + a + a @ a / 2 + a @ a @ a / 6)[:, 1].copy()
        noise += np.outer(column, column) * (density * weight * INTERVAL)
    return noise


@nb.njit
def filtered(drive, signal, density, free, steps, points):
    count = len(signal)
    means, covariances = np.zeros((count, 5)), np.zeros((count, 5, 5))
    predicted, predicted_covariances = np.zeros((count, 5)), np.zeros((count, 5, 5))
    transitions = np.zeros((count, 5, 5))
    x, p = START.copy(), np.diag(START_SD**2 * free)
    for i in range(count):
        if i > 0:
            x, transition = over_a_sample(x, drive, i - 1, steps, points)
            p = transition @ p @ transition.T + process_noise(x, drive[i], density, free)
            transitions[i] = transition
        predicted[i], predicted_covariances[i] = x, p
        comb = COMB * np.exp(-((x[0] / WIDTH) ** 2))
        h = np.zeros(5)
        h[0] = GAIN * (1 + x[3]) * comb * (-2 * x[0] / WIDTH**2)
        h[3] = GAIN * (comb + BIAS)
        h[4] = 1.0
        variance = h @ p @ h + VARIANCE
        gain = p @ h / variance
        x = x + gain * (signal[i] - (GAIN * (1 + x[3]) * (comb + BIAS) + OFFSET + x[4]))
        kept = np.eye(5) - np.outer(gain, h)
        p = kept @ p @ kept.T + np.outer(gain, gain) * VARIANCE
        means[i], covariances[i] = x, p
    return means, covariances, predicted, predicted_covariances, transitions


@nb.njit
def smoothed(means, covariances, predicted, predicted_covariances, transitions):
    """Rauch, Tung and Striebel's recursion; states that are not free have no variance and are left alone."""
    answer = means.copy()
    for i in range(len(means) - 2, -1, -1):
        p = predicted_covariances[i + 1]
        scale = np.zeros(5)
        for j in range(5):
            scale[j] = 1 / np.sqrt(p[j, j]) if p[j, j] > 0 else 0.0
        scales = np.diag(scale)
        one = scales @ p @ scales + np.diag((scale == 0).astype(np.float64))
        gain = covariances[i] @ transitions[i + 1].T @ scales @ np.linalg.inv(one) @ scales
        answer[i] += gain @ (answer[i + 1] - predicted[i + 1])
    return answer


def peaks(time, rate_of_angle):
    before = np.where(rate_of_angle[:-1] * rate_of_angle[1:] < 0)[0]
    a, b = rate_of_angle[before], rate_of_angle[before + 1]
    return time[before] + INTERVAL * a / (a - b)


def errors(time, truth, states):
    late = time >= SKIP
    sign = np.sign(np.sum(states[late, 0] * truth[late, 1]))
    angle = np.degrees(sign * states[late, 0] - truth[late, 1])
    true, estimated = peaks(time[late], truth[late, 2]), peaks(time[late], sign * states[late, 1])
    nearest = np.array([estimated[np.argmin(abs(estimated - at))] - at for at in true])
    phase = nearest[abs(nearest) < 0.25 / MOTION_HZ] * MOTION_HZ * 360
    return {
        "angle_rmse_deg": float(f"{np.sqrt(np.mean(angle**2)):.5g}"),
        "peak_phase_rmse_deg": float(f"{np.sqrt(np.mean(phase**2)):.5g}"),
    }


def main():
    steps, points = (int(word) for word in sys.argv[1:] or (8, 8))
    time, drive, signal = np.loadtxt(os.path.join(FOLDER, "recording.csv"), delimiter=",", skiprows=1).T.copy()
    truth = np.loadtxt(os.path.join(FOLDER, "truth.csv"), delimiter=",", skiprows=1)
    kinds = {
        "ekf2": (1, 1, 0, 0, 0),
        "ekf3_stiffness": (1, 1, 1, 0, 0),
        "ekf5_stiffness_gain_offset": (1, 1, 1, 1, 1),
    }
    found = {}
    for power in (2, 4, 6, 7, 8, 9):
        for name, free in kinds.items():
            run = filtered(drive, signal, 10.0**power, np.array(free, float), steps, points)
            found[f"{name}_q1e+0{power}"] = errors(time, truth, run[0])
            if name != "ekf2":
                found[f"rts_{name}_q1e+0{power}"] = errors(time, truth, smoothed(*run))
    lines = (f"  {json.dumps(key)}: {json.dumps(value)}" for key, value in found.items())
    print("{\n" + ",\n".join(lines) + "\n}")


main()
