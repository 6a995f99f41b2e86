"""Simulates ten recordings, without kalmems: five devices twice, with parameters at random.

    python3 simulate.py FOLDER SEED        (Python 3 with numpy and scipy)

For each device a folder has

    recording.csv   what an operator records: time, drive and signals
    truth.csv       the motion at the samples, which no command reads
    case.json       the device's name, the options of `kalmems new`, and for each number of the experiment file the true value ("right"),
                    the value that an operator has ("told"), and the column of truth.csv that is judged

Of each device the first recording is told right; of the second an operator has every number 3 % wrong that the recording can tell, and
those right that it cannot tell: lengths, areas, masses and gains, which scale the motion and leave the signal as it is.
"""

import json
import sys
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp

EPSILON0 = 8.8541878128e-12  # F/m
BOLTZMANN = 1.380649e-23  # J/K


def near(rng, value, spread=0.05):
    """A number within a spread of a published one, relative to it."""
    return value * (1 + spread * rng.uniform(-1, 1))


def integrate(rates, start, times, step):
    """A smooth motion at these times, by DOP853 with tolerances far below what the recording resolves."""
    found = solve_ivp(rates, (times[0], times[-1]), start, method="DOP853", t_eval=times, rtol=1e-10, atol=1e-14, max_step=step)
    assert found.success, found.message
    return found.y


def first_peak(time, drive, angle, settled):
    """The sign of the first extreme after the first maximum of the drive after the settling time."""
    peaks = np.nonzero((np.diff(drive)[:-1] > 0) & (np.diff(drive)[1:] <= 0) & (time[1:-1] >= settled))[0] + 1
    turns = np.nonzero(np.diff(np.sign(np.diff(angle))))[0] + 1
    first = turns[turns >= peaks[0]][0]
    return "positive" if angle[first] > 0 else "negative"


class Case:
    """One recording, with what is true and what is told."""

    def __init__(self, device, rng, wrong):
        self.device, self.rng, self.wrong = device, rng, wrong
        self.values, self.options, self.columns, self.truth = [], [], {}, {}

    def states(self, table, key, value, unit, known=False):
        """A number of the experiment file: where it is no constant that an operator knows, it is told 3 % wrong of a second recording."""
        told = value
        if self.wrong and not known:
            told = value * (1 + 0.03 * self.rng.choice([-1, 1]))
        text = lambda number: f"{number:.17g} {unit}" if unit else number
        self.values.append({"table": table, "key": key, "right": text(value), "told": text(told)})

    def writes(self, key, text):
        """A line of the experiment file that is no number of the device."""
        self.values.append({"table": "estimate", "key": key, "right": text, "told": text})

    def save(self, folder, judged):
        folder.mkdir(parents=True)
        for name, columns in (("recording.csv", self.columns), ("truth.csv", self.truth)):
            table = np.column_stack(list(columns.values()))
            np.savetxt(folder / name, table, fmt="%.10e", delimiter=",", header=",".join(columns), comments="")
        case = {"device": self.device, "options": self.options, "values": self.values, "judged": judged}
        (folder / "case.json").write_text(json.dumps(case, indent=1))


def shared_scanner(rng, wrong, folder):
    case = Case("shared_scanner", rng, wrong)
    inertia, stiffness = near(rng, 1.15e-14, 0.1), near(rng, 1.10e-4, 0.1)
    damping = near(rng, 5.95e-12)
    c0, width, cb = near(rng, 5.71e-12), near(rng, 0.2), near(rng, 9.79e-12)
    gain, offset, noise = near(rng, -0.3574e12), near(rng, 6.3945), 1.92e-4 * rng.uniform(0.5, 2)
    carrier, scale = 6.0, np.sqrt(stiffness / 1.10e-4)
    frequency = 2 * np.sqrt(stiffness / inertia) / (2 * np.pi) * 1.00701
    # The voltage that modulates this stiffness as deeply as the published one.
    volts = 90 * scale * np.sqrt(5.71e-12 / c0) * width / 0.2

    def drive(t):
        return volts * (1 + np.sin(2 * np.pi * frequency * t))

    def rates(t, x):
        slope = -2 * x[0] / width**2 * c0 * np.exp(-((x[0] / width) ** 2))
        torque = 0.5 * slope * (drive(t) ** 2 + 0.5 * carrier**2)
        return [x[1], (torque - damping * x[1] - stiffness * x[0]) / inertia]

    settling, rate, samples = 0.06, 1e6, 24_001
    times = settling + np.arange(samples) / rate
    sign = rng.choice([-1, 1])
    motion = integrate(rates, [sign * 0.117 * width / 0.2, sign * 12.8e3], np.concatenate([[0.0], times]), 5e-6)[:, 1:]
    assert np.max(np.abs(motion[0])) > 0.06, "the motion has stopped"
    signal = gain * (c0 * np.exp(-((motion[0] / width) ** 2)) + cb) + offset
    time = np.arange(samples) / rate
    case.columns = {"time_s": time, "drive_V": drive(times), "cap_V": signal + np.sqrt(noise) * rng.standard_normal(samples)}
    case.truth = {"time_s": time, "angle": motion[0]}
    table = "device.shared_scanner."
    case.states(table + "resonator", "inertia", inertia, "kg m^2", known=True)
    case.states(table + "resonator", "stiffness", stiffness, "N m")
    case.states(table + "resonator", "damping", damping, "N m s")
    case.states(table + "comb", "nominal_capacitance", c0, "F", known=True)
    case.states(table + "comb", "angular_width", width, "rad", known=True)
    case.states(table + "comb", "bias_capacitance", cb, "F", known=True)
    case.states(table + "readout", "gain", gain, "V/F", known=True)
    case.states(table + "readout", "offset", offset, "V", known=True)
    case.writes("first_peak", first_peak(time, drive(times), motion[0], 0.0048))
    case.save(folder, "angle")


def threshold_scanner(rng, wrong, folder):
    case = Case("threshold_scanner", rng, wrong)
    frequency, damping = near(rng, 624.6, 0.1), near(rng, 0.0066, 0.1)
    threshold, gain, steepness = near(rng, 3.7e-3, 0.1), near(rng, 2.82e-3, 0.1), near(rng, 76)
    noise = 1.89225e-3 * rng.uniform(0.2, 1)
    omega = 2 * np.pi * frequency
    damped = omega * np.sqrt(1 - damping**2)
    amplitude, phase = near(rng, 0.147, 0.1), rng.uniform(0, 2 * np.pi)
    samples, rate = 12_001, 500e3
    time = np.arange(samples) / rate
    decay = amplitude * np.exp(-damping * omega * time)
    angle = decay * np.cos(damped * time + phase)
    turning = -damping * omega * angle - decay * damped * np.sin(damped * time + phase)
    shape = 1 / (1 + np.exp(-steepness * (angle - threshold))) - 0.5
    signal = gain * shape * turning
    case.columns = {"time_s": time, "drive_V": 0 * time, "signal_V": signal + np.sqrt(noise) * rng.standard_normal(samples)}
    case.truth = {"time_s": time, "angle": angle}
    table = "device.threshold_scanner."
    case.states(table + "resonator", "natural_frequency", frequency, "Hz")
    case.states(table + "resonator", "damping_ratio", damping, "")
    case.states(table + "comb", "threshold_angle", threshold, "rad", known=True)
    case.states(table + "comb", "gain", gain, "V s/rad")
    case.states(table + "comb", "steepness", steepness, "1/rad", known=True)
    case.save(folder, "angle")


def micro_stage(rng, wrong, folder):
    case = Case("micro_stage", rng, wrong)
    frequency, damping, drive_gain = near(rng, 1714.5), near(rng, 5e-3), near(rng, 3782.5)
    omega = 2 * np.pi * frequency
    driven = frequency * rng.uniform(0.985, 0.995)
    samples, rate = 12_501, 625e3
    time = np.arange(samples) / rate
    volts = near(rng, 1.2)

    def drive(t):
        return volts * np.sin(2 * np.pi * driven * t)

    def rates(t, x):
        return [x[1], drive_gain * drive(t) - 2 * damping * omega * x[1] - omega**2 * x[0]]

    angle, turning = integrate(rates, [0.0, 0.0], time, 2e-5)
    case.columns = {"time_s": time, "drive_V": drive(time)}
    case.truth = {"time_s": time, "rate": turning}
    for name, (w1, w2) in {
        "1A": (-1.39e-3, -0.99e-3), "1B": (475e-6, 795e-6), "2A": (0.99e-3, 1.39e-3), "2B": (-795e-6, -475e-6),
    }.items():
        gap, gain, noise = near(rng, 19.2e-6, 0.03), near(rng, -2.40752e7, 0.03), 1.6e-11 * rng.uniform(0.5, 2)
        # dC/dtheta of the integral of epsilon * 0.4 mm / (gap - w tan theta) over w, by the middle of 2000 strips.
        edges = np.linspace(w1, w2, 2001)
        w, width = 0.5 * (edges[1:] + edges[:-1]), edges[1] - edges[0]
        slope = np.array([np.sum(EPSILON0 * 0.4e-3 * width * w * (1 + np.tan(a) ** 2) / (gap - w * np.tan(a)) ** 2) for a in angle])
        signal = gain * slope * turning
        case.columns[f"cap{name}_V"] = signal + np.sqrt(noise) * rng.standard_normal(samples)
        table = f"device.micro_stage.electrodes.{name}"
        case.states(table, "gap", gap, "m", known=True)
        case.states(table, "gain", gain, "V ohm", known=True)
    case.states("device.micro_stage.resonator", "natural_frequency", frequency, "Hz")
    case.states("device.micro_stage.resonator", "damping_ratio", damping, "")
    case.states("device.micro_stage.resonator", "drive_gain", drive_gain, "rad/s^2/V")
    case.save(folder, "rate")


def accelerometer(rng, wrong, folder):
    case = Case("accelerometer", rng, wrong)
    mass, spring, damping = near(rng, 3.8e-9), near(rng, 3.0), near(rng, 7e-4)
    area, gap, permittivity = near(rng, 1.86e-6, 0.02), near(rng, 2.3e-6, 0.02), 4.0
    carrier, feedback, noise = 0.6, 20e-12, 4.88e-9 * rng.uniform(0.5, 2)
    gravity, corner, ratio = 9.80665, 2 * np.pi * 50.0, 0.7071
    rate, steps, samples = 100e3, 10, 20_001
    h = 1 / (rate * steps)
    plates, mean_square = EPSILON0 * permittivity * area, 0.5 * carrier**2
    force_sd = np.sqrt(2 * BOLTZMANN * 300.0 * damping / h)
    drift_sd = np.sqrt(4 * ratio * corner**3 * gravity**2 * h)
    x = v = 0.0
    a, jerk = gravity * rng.standard_normal(), gravity * corner * rng.standard_normal()
    decay = np.exp(-damping / mass * h)
    positions, accelerations = np.empty(samples), np.empty(samples)
    for sample in range(samples):
        positions[sample], accelerations[sample] = x, a
        pushes, drifts = force_sd * rng.standard_normal(steps), drift_sd * rng.standard_normal(steps)
        for push, drift in zip(pushes, drifts):
            pull = 0.5 * plates * mean_square * (1 / (gap - x) ** 2 - 1 / (gap + x) ** 2)
            # The velocity decays within some steps: exactly, towards that at which the gas carries the force.
            limit = (mass * a + push + pull - spring * x) / damping
            x += limit * h + (v - limit) * (1 - decay) * mass / damping
            v = limit + (v - limit) * decay
            jerk += (-2 * ratio * corner * jerk - corner**2 * a) * h + drift
            a += jerk * h
    sensitivity = 2 * plates * carrier / (feedback * gap**2)
    signal = sensitivity * positions / (1 - (positions / gap) ** 2)
    time = np.arange(samples) / rate
    case.columns = {"time_s": time, "out_V": signal + np.sqrt(noise) * rng.standard_normal(samples)}
    case.truth = {"time_s": time, "acceleration": accelerations}
    table = "device.accelerometer."
    case.states(table + "proof_mass", "mass", mass, "kg", known=True)
    case.states(table + "proof_mass", "spring", spring, "N/m", known=True)
    case.states(table + "proof_mass", "damping", damping, "N s/m")
    case.states(table + "plates", "area", area, "m^2", known=True)
    case.states(table + "plates", "gap", gap, "m", known=True)
    case.save(folder, "acceleration")


def piston_mirror(rng, wrong, folder):
    case = Case("piston_mirror", rng, wrong)
    capacitance, noise = near(rng, 109.3e-15, 0.1), 0.151e-18 * rng.uniform(0.7, 1.5)
    amplitude, frequency = near(rng, 0.5e-3, 0.1), near(rng, 500.0, 0.1)
    phase, rest = rng.uniform(0, 2 * np.pi), near(rng, 1e-3)
    samples, rate = 10_001, 20e3
    time = np.arange(samples) / rate
    position = rest + amplitude * np.cos(2 * np.pi * frequency * time + phase)
    sd = noise * np.sqrt(rate / 2)
    case.columns = {"time_s": time, "cap_F": capacitance * 1e-3 / position + sd * rng.standard_normal(samples)}
    case.truth = {"time_s": time, "position": position}
    coefficients = f'["0 F", "{capacitance:.17g} F"]'
    case.values.append({
        "table": "device.piston_mirror.capacitance", "key": "coefficients", "right": coefficients, "told": coefficients, "plain": True,
    })
    case.save(folder, "position")


def main():
    folder, seed = Path(sys.argv[1]), int(sys.argv[2])
    for place, simulate in enumerate([shared_scanner, threshold_scanner, micro_stage, accelerometer, piston_mirror]):
        for wrong in (False, True):
            rng = np.random.default_rng([seed, place, int(wrong)])
            simulate(rng, wrong, folder / f"{simulate.__name__}_{'wrong' if wrong else 'right'}")


main()
