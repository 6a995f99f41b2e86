"""A real unit in positions: the record of IMU-TK at a quarter of its rate, and its solution by NumPy and SciPy, which share no code with this project.

    python3 xsens.py FOLDER        (NumPy, SciPy; FOLDER holds xsens_acc.mat and xsens_gyro.mat of IMU-TK)

writes `xsens.npz`, the sums of four neighbouring codes of each sensor, and `xsens.json` next to this script. Rests are where the variance in a window of
1 s is below four times that of the first minute. The accelerometers' numbers minimise the differences of the magnitude of the specific force from gravity
over the rests' means. The gyroscopes' matrix minimises those of its direction, which quaternions by the midpoint of two samples turn through the motions.
"""

import json
import os
import sys

import numpy as np
from scipy.optimize import least_squares

HERE = os.path.dirname(os.path.abspath(__file__))
GRAVITY, SUMMED = 9.81744, 4
# What the maker states, and what is near to the codes at rest.
ACCELEROMETERS, FORCES = np.array([415.0, 413.0, 415.0]), np.array([-79.81, -80.57, -77.98])
GYROSCOPES, RATES = np.array([4778.0, 4758.0, 4766.0]), np.array([-6.858, -6.823, -6.816])


def summed(folder):
    both = [np.loadtxt(os.path.join(folder, f"xsens_{name}.mat")) for name in ("acc", "gyro")]
    time, codes = both[0][:, 0], np.hstack([one[:, 1:] for one in both]).astype(int)
    rows = len(codes) // SUMMED * SUMMED
    sums = codes[:rows].reshape(-1, SUMMED, 6).sum(1).astype(np.uint32)
    names = ["ax", "ay", "az", "gx", "gy", "gz"]
    np.savez_compressed(os.path.join(HERE, "xsens.npz"), **{name: sums[:, k] for k, name in enumerate(names)})
    return (len(time) - 1) / (time[-1] - time[0]) / SUMMED, sums


def rests(forces, rate_hz):
    half = int(rate_hz / 2)
    width = 2 * half + 1
    off = forces - forces.mean(0)
    first, second = (np.cumsum(np.vstack([np.zeros(3), x]), 0) for x in (off, off * off))
    mean = (first[width:] - first[:-width]) / width
    variance = ((second[width:] - second[:-width]) / width - mean * mean).sum(1)
    variance = np.concatenate([np.full(half, np.inf), variance, np.full(half, np.inf)])
    still = variance < 4 * variance[int(5 * rate_hz) : int(45 * rate_hz)].mean()
    edges = np.flatnonzero(np.diff(np.concatenate([[0], still.astype(int), [0]])))
    return [(a, b) for a, b in edges.reshape(-1, 2) if b - a >= rate_hz]


def numbers(sensor, matrix):
    sizes = np.linalg.norm(matrix, axis=1)
    rows = matrix / sizes[:, None]
    found = {f"{sensor}_scale_factor_{axis}": size for axis, size in zip("xyz", sizes)}
    pairs = {"xy": rows[0] @ rows[1], "xz": rows[0] @ rows[2], "yz": rows[1] @ rows[2]}
    return found | {f"{sensor}_non_orthogonality_{pair}": value for pair, value in pairs.items()}


def force(p, shown):
    matrix = np.array([[p[0], 0, 0], [p[1], p[2], 0], [p[3], p[4], p[5]]])
    return (shown - p[6:9]) @ matrix.T, matrix


def turned(quaternion, rate, duration):
    angle = np.linalg.norm(rate) * duration
    if angle < 1e-12:
        return quaternion
    axis = rate / np.linalg.norm(rate)
    by = np.array([np.cos(angle / 2), *(np.sin(angle / 2) * axis)])
    vector = quaternion[0] * by[1:] + by[0] * quaternion[1:] + np.cross(quaternion[1:], by[1:])
    return np.array([quaternion[0] * by[0] - quaternion[1:] @ by[1:], *vector])


def into_body(quaternion, vector):
    w, r = quaternion[0], -quaternion[1:]
    return vector + 2 * np.cross(r, np.cross(r, vector) + w * vector)


def main(folder):
    rate_hz, sums = summed(folder)
    forces = sums[:, :3] / SUMMED / ACCELEROMETERS + FORCES
    rates = sums[:, 3:] / SUMMED / GYROSCOPES + RATES
    parts = rests(forces, rate_hz)
    means, biases = (np.array([x[a:b].mean(0) for a, b in parts]) for x in (forces, rates))
    start = [1.0, 0, 1, 0, 0, 1, 0, 0, 0]
    fit = least_squares(lambda p: np.linalg.norm(force(p, means)[0], axis=1) - GRAVITY, start)
    up, matrix = force(fit.x, means)
    up /= np.linalg.norm(up, axis=1)[:, None]
    solved = numbers("accelerometer", np.linalg.inv(matrix))
    solved |= {f"accelerometer_bias_{axis}": value for axis, value in zip("xyz", fit.x[6:])}
    motions = []
    for k, ((_, end), (begin, _)) in enumerate(zip(parts, parts[1:])):
        motions.append((k, rates[end - 1 : begin + 1] - (biases[k] + biases[k + 1]) / 2))

    def residuals(p):
        left = []
        for k, shown in motions:
            rate, quaternion = shown @ p.reshape(3, 3).T, np.array([1.0, 0, 0, 0])
            for one, other in zip(rate, rate[1:]):
                quaternion = turned(quaternion, (one + other) / 2, 1 / rate_hz)
            left += list(into_body(quaternion, up[k]) - up[k + 1])
        return np.array(left)

    turns = least_squares(residuals, np.eye(3).ravel(), method="lm", diff_step=1e-6)
    solved |= numbers("gyroscope", np.linalg.inv(turns.x.reshape(3, 3)))
    result = {"rate_hz": rate_hz, "positions": len(parts), "solved": solved}
    with open(os.path.join(HERE, "xsens.json"), "w", encoding="utf-8") as file:
        json.dump(result, file, indent=1, default=float)
        file.write("\n")


main(sys.argv[1])
