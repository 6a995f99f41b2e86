"""Simulates the quartz tuning fork of this folder, without kalmems: writes recording.csv and reference.csv beside itself.

    python simulate.py        (Python 3 with numpy and scipy)

Both prongs move by x against each other's direction. The piezoelectric effect turns a voltage into a force and the motion into
charge, by the same factor a:

    m x'' + b x' + k x = a V(t) + F(t)
    Q = a x + C0 V(t)
    Cf u' + u/Rf = -Q'

u is the output of a charge amplifier whose feedback is Cf beside Rf. With p = Q low-passed by Rf Cf (Rf Cf p' + p = Q) it is
u = -(Q - p)/Cf, in which no voltage is differentiated. F is the thermal force of the damping, white with the two-sided density
2 kT b; it is held constant over each sampling interval with the variance 2 kT b / interval. Recorded are V and u + noise.

Every interval is integrated by scipy's DOP853 with tolerances far below what the recording resolves. The constants below are the
truth; experiment.toml states other values for k, b, a, C0 and Rf, within the uncertainty that it states.
"""

from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp

MASS = 6.6e-7  # kg: the effective mass of both prongs
STIFFNESS = MASS * (2 * np.pi * 32_755.0) ** 2  # N/m: 27 954.9
DAMPING = MASS * 2 * np.pi * 32_755.0 / 9200.0  # N s/m: a quality factor of 9200, in air
COUPLING = 9.00e-6  # C/m = N/V: a motional capacitance a^2/k of 2.90 fF and a motional inductance m/a^2 of 8.15 kH
SHUNT_CAPACITANCE = 1.25e-12  # F
FEEDBACK_CAPACITANCE = 4.7e-12  # F
FEEDBACK_RESISTANCE = 21.6e6  # ohm: with Cf a corner of 1.57 kHz
THERMAL_ENERGY = 4.0453e-21  # J: kT at 293 K
NOISE_SD = 50e-6  # V per sample: 71 nV/sqrt(Hz) over 500 kHz

AMPLITUDE, FREQUENCY = 0.1, 32_760.0  # V, Hz
RATE, SAMPLES, SEED = 1e6, 12_000, 20_262  # Hz, 12 ms
HERE = Path(__file__).parent


def drive(t):
    return AMPLITUDE * np.sin(2 * np.pi * FREQUENCY * t)


def charge(t, x):
    return COUPLING * x + SHUNT_CAPACITANCE * drive(t)


def rates(t, state, force):
    x, v, passed = state
    pull = COUPLING * drive(t) + force
    time_constant = FEEDBACK_RESISTANCE * FEEDBACK_CAPACITANCE
    return [v, (pull - DAMPING * v - STIFFNESS * x) / MASS, (charge(t, x) - passed) / time_constant]


def main():
    of_force, of_samples, of_start = (
        np.random.default_rng(seed) for seed in np.random.SeedSequence(SEED).spawn(3)
    )
    time = np.arange(SAMPLES) / RATE
    forces = np.sqrt(2 * THERMAL_ENERGY * DAMPING * RATE) * of_force.standard_normal(SAMPLES)
    states = np.empty((SAMPLES, 3))
    # In thermal equilibrium, until the voltage begins at the first sample.
    thermal = np.sqrt(THERMAL_ENERGY / np.array([STIFFNESS, MASS]))
    states[0, :2] = thermal * of_start.standard_normal(2)
    states[0, 2] = 0.0
    for k in range(1, SAMPLES):
        over = (time[k - 1], time[k])
        solved = solve_ivp(
            rates, over, states[k - 1], "DOP853", args=(forces[k],), rtol=1e-11, atol=[1e-19, 1e-14, 1e-24]
        )
        states[k] = solved.y[:, -1]
    x, v, passed = states.T
    output = -(charge(time, x) - passed) / FEEDBACK_CAPACITANCE
    signal = output + NOISE_SD * of_samples.standard_normal(SAMPLES)
    with open(HERE / "recording.csv", "w") as file:
        file.write("time_s,drive_V,signal_V\n")
        for row in zip(time, drive(time), signal):
            file.write("%.10g,%.7f,%.6f\n" % row)
    with open(HERE / "reference.csv", "w") as file:
        file.write("time_s,x_m,v_m_per_s\n")
        for row in zip(time, x, v):
            file.write("%.10g,%.7g,%.7g\n" % row)
    print("largest |x| %.4g m, signal within %.3g V" % (np.abs(x).max(), np.abs(signal).max()))


if __name__ == "__main__":
    main()
