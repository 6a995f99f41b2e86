"""A simulated inertial unit that shares no code with this project, its records, and solutions of them by SciPy.

    python3 inertial_unit.py        (NumPy, SciPy)

writes the recordings of `examples/inertial_unit` and `inertial_unit.json` next to this script: the values that were put in, and what other
methods find in the same recordings: for the positions the costs of Tedaldi, Pretto and Menegatti (2014) with quaternions and the method of Runge and
Kutta.
"""

import json
import os

import numpy as np
from scipy.integrate import simpson
from scipy.optimize import brentq, least_squares
from scipy.signal import lsim
from scipy.spatial.transform import Rotation

HERE = os.path.dirname(os.path.abspath(__file__))
EXAMPLE = os.path.join(HERE, "..", "..", "..", "..", "examples", "inertial_unit")
GRAVITY, EARTH, LATITUDE = 9.80943, 7.292115e-5, np.radians(48.1)
ACCELEROMETERS = np.array([[1.0085, 0.0031, -0.0046], [-0.0052, 0.9941, 0.0027], [0.0018, -0.0044, 1.0127]])
ACCELEROMETER_BIAS = np.array([0.062, -0.118, 0.035])
GYROSCOPES = np.array([[1.0112, -0.0037, 0.0051], [0.0063, 0.9928, -0.0029], [-0.0048, 0.0036, 0.9875]])
GYROSCOPE_BIAS = np.array([0.0052, -0.0031, 0.0078])
FORCE_SENSITIVITY = np.diag([3e-5, -2e-5, 5e-5])
ACCELEROMETER_NOISE, GYROSCOPE_NOISE, SCATTER = 4e-3, 1.5e-3, 6e-4


def shown(force, rate, random):
    accelerometers = ACCELEROMETERS @ force + ACCELEROMETER_BIAS + ACCELEROMETER_NOISE * random.standard_normal(3)
    gyroscopes = GYROSCOPES @ rate + FORCE_SENSITIVITY @ force + GYROSCOPE_BIAS
    return np.concatenate([accelerometers, gyroscopes + GYROSCOPE_NOISE * random.standard_normal(3)])


def write(name, header, rows, digits):
    with open(os.path.join(EXAMPLE, name), "w", encoding="utf-8") as file:
        file.write(",".join(header) + "\n")
        for row in rows:
            file.write(",".join(f"{value:.{digit}f}" for value, digit in zip(row, digits)) + "\n")


CHANNELS = ["acc_x_gn", "acc_y_gn", "acc_z_gn", "gyro_x_dps", "gyro_y_dps", "gyro_z_dps"]


def in_units(sample):
    return np.concatenate([sample[:3] / 9.80665, np.degrees(sample[3:])])


def positions(random):
    """Rests of 1.6 s in 20 positions, with turns of 1 s between them, at 50 Hz."""
    rate_hz, rest, turn, fine = 50.0, 80, 50, 64
    attitude = Rotation.from_euler("xyz", [0.1, -0.2, 0.3])  # from the body to the world
    samples, rests = [], []

    def at(rate, acceleration_of_rate, off):
        back = attitude.inv()
        earth = back.apply([EARTH * np.cos(LATITUDE), 0.0, EARTH * np.sin(LATITUDE)])
        arm = np.array([0.04, 0.02, -0.03])
        force = back.apply([0.0, 0.0, GRAVITY]) + np.cross(acceleration_of_rate, arm)
        force = force + np.cross(rate, np.cross(rate, arm)) + off
        samples.append(in_units(shown(force, rate + earth, random)))

    for position in range(20):
        off = SCATTER * random.standard_normal(3)
        rests.append((len(samples), len(samples) + rest))
        for _ in range(rest):
            at(np.zeros(3), np.zeros(3), off)
        if position == 19:
            break
        axes = random.standard_normal((2, 3))
        axes = (axes.T / np.linalg.norm(axes, axis=1)).T * np.array([[1.3], [0.9]])

        def rate(t):
            swell = lambda s: 2.0 * np.sin(np.pi * s) ** 2 if 0.0 < s < 1.0 else 0.0
            return (axes[0] * swell(t / 0.75) + axes[1] * swell((t - 0.25) / 0.75)) / 0.75

        for sample in range(turn):
            now = sample / rate_hz
            at(rate(now), (rate(now + 1e-5) - rate(now - 1e-5)) / 2e-5, np.zeros(3))
            step = 1.0 / rate_hz / fine
            for k in range(fine):
                attitude = attitude * Rotation.from_rotvec(rate(now + (k + 0.5) * step) * step)
    return np.array(samples), rests, rate_hz


def solved(samples, rests, rate_hz):
    force, rate = samples[:, :3] * 9.80665, np.radians(samples[:, 3:])
    inner = [(start + 10, end - 10) for start, end in rests]
    means = np.array([force[a:b].mean(axis=0) for a, b in inner])
    rest_rates = np.array([rate[a:b].mean(axis=0) for a, b in inner])

    def calibrated(p, shown_force):
        misaligned = np.array([[1.0, -p[0], p[1]], [0.0, 1.0, -p[2]], [0.0, 0.0, 1.0]])
        return (misaligned @ np.diag(p[3:6]) @ (shown_force - p[6:9]).T).T

    def gravity(p):
        return GRAVITY**2 - (calibrated(p, means) ** 2).sum(axis=1)

    found = least_squares(gravity, [0, 0, 0, 1, 1, 1, 0, 0, 0], xtol=1e-15, ftol=1e-15, gtol=1e-15).x
    up = calibrated(found, means)
    up = (up.T / np.linalg.norm(up, axis=1)).T

    def turned(start, rates):
        """The direction after the rates, by a quaternion and the method of Runge and Kutta."""

        def derivative(q, w):
            x, y, z = w
            return 0.5 * np.array([[0, -x, -y, -z], [x, 0, z, -y], [y, -z, 0, x], [z, y, -x, 0]]) @ q

        q, step = np.array([1.0, 0, 0, 0]), 1.0 / rate_hz
        for first, second in zip(rates[:-1], rates[1:]):
            middle = 0.5 * (first + second)
            a = derivative(q, first)
            b = derivative(q + 0.5 * step * a, middle)
            c = derivative(q + 0.5 * step * b, middle)
            d = derivative(q + step * c, second)
            q = q + step / 6.0 * (a + 2 * b + 2 * c + d)
            q /= np.linalg.norm(q)
        return Rotation.from_quat([q[1], q[2], q[3], q[0]]).inv().apply(start)

    def directions(p):
        matrix = p.reshape(3, 3)
        each = []
        for k in range(len(inner) - 1):
            first, last = inner[k][1] - 1, inner[k + 1][0]
            bias = 0.5 * (rest_rates[k] + rest_rates[k + 1])
            rates = (matrix @ (rate[first : last + 1] - bias).T).T
            each.append(turned(up[k], rates) - up[k + 1])
        return np.concatenate(each)

    inverse = least_squares(directions, np.eye(3).ravel(), xtol=1e-12).x.reshape(3, 3)
    accelerometers = np.linalg.inv(np.array([[1.0, -found[0], found[1]], [0, 1, -found[2]], [0, 0, 1]]) @ np.diag(found[3:6]))
    # The frame of Tedaldi's triangular matrix is another one than that of ours; lengths and angles are the same in all.
    return accelerometers, found[6:9], np.linalg.inv(inverse)


def numbers(accelerometers, bias, gyroscopes):
    result = {}
    for sensor, matrix in (("accelerometer", accelerometers), ("gyroscope", gyroscopes)):
        rows = (matrix.T / np.linalg.norm(matrix, axis=1)).T
        for place, axis in enumerate("xyz"):
            result[f"{sensor}_scale_factor_{axis}"] = float(np.linalg.norm(matrix[place]))
        for first, second in ((0, 1), (0, 2), (1, 2)):
            result[f"{sensor}_non_orthogonality_{'xyz'[first]}{'xyz'[second]}"] = float(rows[first] @ rows[second])
    for place, axis in enumerate("xyz"):
        result[f"accelerometer_bias_{axis}"] = float(bias[place])
    return result


def rest(random):
    """Seven minutes at 20 Hz: white noise and a random walk of one accelerometer and one gyroscope."""
    count, rate_hz = 8400, 20.0
    velocity_walk, acceleration_walk, angle_walk = 6e-4, 2e-5, 1.2e-4
    force = 9.80943 + velocity_walk * np.sqrt(rate_hz) * random.standard_normal(count)
    force += np.cumsum(acceleration_walk / np.sqrt(rate_hz) * random.standard_normal(count))
    rate = 0.0052 + angle_walk * np.sqrt(rate_hz) * random.standard_normal(count)
    put_in = {
        "velocity random walk": velocity_walk,
        "acceleration random walk": acceleration_walk,
        "angle random walk": angle_walk,
    }
    return np.column_stack([force / 9.80665, np.degrees(rate)]), put_in


def table(random):
    """A staircase of a rate table about z, up and down, at 50 Hz; the means of the steps by NumPy."""
    levels = np.array([-200, -150, -100, -50, 0, 50, 100, 150, 200.0])
    rates = np.concatenate([levels, levels[-2::-1]])
    hold, ramp = 100, 30
    bias, scale, square, cube, hysteresis = 0.447, 0.9875, 2e-7, -3e-9, 0.01  # in deg/s and its powers
    rows, means, before = [], [], rates[0]
    for rate in rates:
        direction = np.sign(rate - before)
        off = 0.004 * random.standard_normal()
        now = np.concatenate([before + (rate - before) * np.sin(0.5 * np.pi * np.arange(ramp) / ramp) ** 2, np.full(hold, rate)])
        shown = bias + scale * now + square * now**2 + cube * now**3 + 0.5 * hysteresis * direction
        shown = np.round(shown + np.where(np.arange(ramp + hold) >= ramp, off, 0.0) + 0.08 * random.standard_normal(len(now)), 4)
        cross = np.round(0.0051 * now + 0.08 * random.standard_normal(len(now)), 4)
        other = np.round(-0.0036 * now + 0.08 * random.standard_normal(len(now)), 4)
        rows += list(zip(np.round(now, 4), cross, other, shown))
        means.append((rate, direction, shown[ramp + 12 :].mean()))
        before = rate
    means = np.array(means)
    x, s = means[:, 0], means[:, 1]
    found = np.linalg.lstsq(np.column_stack([np.ones_like(x), x, abs(x), x**2, x**3, s]), means[:, 2], rcond=None)[0]
    line = lambda values: np.polyfit(x, values, 1)[0]
    fitted = np.column_stack([np.ones_like(x), x, abs(x), x**2, x**3]) @ found[:5]
    put_in = bias + scale * x + square * x**2 + cube * x**3
    solved = {"scale_factor_z": line(fitted), "bias_z": np.radians(found[0]), "hysteresis_z": np.radians(2 * found[5])}
    truth = {"scale_factor_z": line(put_in), "bias_z": np.radians(bias), "hysteresis_z": np.radians(hysteresis)}
    truth["cross_axis_sensitivity_xz"] = 0.0051
    return rows, {key: float(value) for key, value in truth.items()}, {key: float(value) for key, value in solved.items()}


def cycle(random):
    """A gyroscope at rest while the temperature rises from 260 to 340 K and falls again, at 4 Hz."""
    count = 4800
    up = np.arange(count) < count // 2
    part = np.where(up, np.arange(count) / (count // 2), 2.0 - np.arange(count) / (count // 2))
    temperature = 260.0 + 80.0 * part
    off = temperature - 300.0
    bias = np.where(up, 0.40 + 1e-3 * off - 6e-6 * off**2, 0.42 + 1.1e-3 * off - 6e-6 * off**2)  # deg/s
    put_in = {
        "gyroscope_bias_z_up_0": 0.40, "gyroscope_bias_z_up_1": 1e-3, "gyroscope_bias_z_up_2": -6e-6,
        "gyroscope_bias_z_down_0": 0.42, "gyroscope_bias_z_down_1": 1.1e-3, "gyroscope_bias_z_down_2": -6e-6,
        "gyroscope_bias_z_hysteresis": -0.02,
    }  # fmt: skip
    rows = np.column_stack([temperature, bias + 0.05 * random.standard_normal(count)])
    return rows, {name: float(np.radians(value)) for name, value in put_in.items()}


def turns(random):
    """Sixteen turns of the z gyroscope by 90 degrees to either side, with rests of 2 s, at 50 Hz; the integrals by Simpson's rule."""
    rate_hz, rest, bias, scale, asymmetry = 50.0, 100, 0.447, 0.9875, 4e-4
    sides = [1, 1, -1, -1] * 4
    cross, shown, angles = [], [], []

    def add(rate, slope):
        cross.append(0.0051 * rate + 0.08 * random.standard_normal())
        shown.append(bias + slope * rate + 0.08 * random.standard_normal())

    for side in sides:
        for _ in range(rest):
            add(0.0, 0.0)
        angle = side * (90.0 + 0.01 * random.standard_normal())  # what the stop is off
        samples = int(50 + 20 * random.random())
        for k in range(samples):
            add(angle * rate_hz / samples * 2 * np.sin(np.pi * k / samples) ** 2, scale * (1 + 0.5 * asymmetry * side))
        angles.append((len(shown) - samples, samples))
    for _ in range(rest):
        add(0.0, 0.0)
    rows = np.round(np.column_stack([cross, shown]), 4)
    integrals = []
    for first, samples in angles:
        off = 0.5 * (rows[first - rest : first, 1].mean() + rows[first + samples : first + samples + rest, 1].mean())
        margin = slice(first - 10, first + samples + 11)
        integrals.append(simpson(rows[margin, 1] - off, dx=1 / rate_hz))
    x, y = 90.0 * np.array(sides), np.array(integrals)
    slope, magnitude = np.linalg.lstsq(np.column_stack([x, abs(x)]), y, rcond=None)[0]
    solved = {"scale_factor_z": slope, "asymmetry_z": 2 * magnitude / slope}
    put_in = {"scale_factor_z": scale, "asymmetry_z": asymmetry, "cross_axis_sensitivity_xz": 0.0051}
    return rows, put_in, {key: float(value) for key, value in solved.items()}


def sweep(random):
    """A sweep from 3 to 110 Hz over 12 s at 250 Hz of an accelerometer of second order with a bandwidth near 60 Hz."""
    rate_hz, span, resonance, damping, scale = 250.0, 12.0, 60.0, 0.7, 0.9941
    fine = 64
    time = np.arange(int(rate_hz * (span + 1)) * fine) / (rate_hz * fine)
    swell = np.clip(np.minimum(time - 0.2, span - 0.2 - time) / 0.3, 0, 1)
    force = 12.0 * np.sin(0.5 * np.pi * swell) ** 2 * np.sin(2 * np.pi * (3.0 * time + 0.5 * 107.0 * time**2 / span))
    turn = 2 * np.pi * resonance
    answer = lsim(([turn**2], [1, 2 * damping * turn, turn**2]), force, time)[1]
    force, answer = force[::fine], 0.3 + scale * answer[::fine]
    force = force + 2e-3 * random.standard_normal(len(force))
    answer = answer + 0.02 * random.standard_normal(len(answer))
    put_in = {"scale_factor": scale, "resonance_hz": resonance, "damping": damping}
    # Where |H| falls to 0.707 of its value at 3 Hz.
    size = lambda f: 1 / np.hypot(1 - (f / resonance) ** 2, 2 * damping * f / resonance)
    put_in["bandwidth_hz"] = float(brentq(lambda f: size(f) - np.sqrt(0.5) * size(3.0), 20, 110))
    return np.column_stack([force, answer / 9.80665]), put_in


def main():
    random = np.random.default_rng(20261128)
    os.makedirs(EXAMPLE, exist_ok=True)
    samples, rests, rate_hz = positions(random)
    digits = [5, 5, 5, 4, 4, 4]
    write("positions.csv", CHANNELS, samples, digits)
    written = np.column_stack([np.round(samples[:, k], digits[k]) for k in range(6)])
    rest_samples, noises = rest(random)
    write("rest.csv", ["acc_z_gn", "gyro_z_dps"], rest_samples, [6, 5])
    rows, truth, solved_table = table(random)
    write("table.csv", ["table_dps", "gyro_x_dps", "gyro_y_dps", "gyro_z_dps"], rows, [4, 4, 4, 4])
    rows, of_cycle = cycle(random)
    write("cycle.csv", ["unit_K", "gyro_z_dps"], rows, [2, 4])
    random = np.random.default_rng(20261129)
    rows, of_turns, solved_turns = turns(random)
    write("turns.csv", ["gyro_x_dps", "gyro_z_dps"], rows, [4, 4])
    rows, of_sweep = sweep(random)
    write("sweep.csv", ["reference_m_per_s2", "acc_x_gn"], rows, [4, 5])
    result = {
        "turns": {"put_in": of_turns, "solved": solved_turns},
        "sweep": {"put_in": of_sweep},
        "positions": {
            "put_in": numbers(ACCELEROMETERS, ACCELEROMETER_BIAS, GYROSCOPES),
            "solved": numbers(*solved(written, rests, rate_hz)),
        },
        "rest": noises,
        "rates": {"put_in": truth, "solved": solved_table},
        "temperature": {"put_in": of_cycle},
    }
    with open(os.path.join(HERE, "inertial_unit.json"), "w", encoding="utf-8") as file:
        json.dump(result, file, indent=1, sort_keys=True)
        file.write("\n")


if __name__ == "__main__":
    main()
