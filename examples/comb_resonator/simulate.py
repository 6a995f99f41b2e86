"""Simulates the comb resonator of this folder, without kalmems: writes recording.csv and reference.csv beside itself.

    python simulate.py        (Python 3 with numpy and scipy)

A shuttle of mass m on springs, driven by a comb and read through an amplifier with one pole:

    m x'' + b x' + k x (1 + h x^2) = g V(t)^2 + F(t)
    tau u' + u = s x

F is the thermal force of the damping, white with the two-sided density 2 kT b. It is held constant over each sampling interval
with the variance 2 kT b / interval. What is recorded at each sample is V and u + noise.

Every interval is integrated by scipy's DOP853 with tolerances far below what the recording resolves. The constants below are the
truth; experiment.toml states other values for k, b, h, g and tau, within the uncertainty that it states.
"""

from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp

MASS = 1.2e-9  # kg: 230 um x 230 um x 10 um of silicon
STIFFNESS = 4.7100  # N/m
DAMPING = 2.92e-7  # N s/m; a quality factor of sqrt(k m)/b = 257
HARDENING = 6.40e8  # 1/m^2
FORCE = 3.00e-9  # N/V^2, half of dC/dx: 68 fingers with gaps of 2 um, 10 um thick
SENSITIVITY = 0.2e6  # V/m
AMPLIFIER_TIME = 4.10e-6  # s: a pole at 38.8 kHz
THERMAL_ENERGY = 4.0453e-21  # J: kT at 293 K
NOISE_SD = 1e-3  # V per sample

BIAS, AMPLITUDE, FREQUENCY = 10.0, 2.0, 10.00e3  # V, V, Hz
RATE, SAMPLES, SEED = 400e3, 12_000, 20_261  # Hz, 30 ms
HERE = Path(__file__).parent


def drive(t):
    return BIAS + AMPLITUDE * np.sin(2 * np.pi * FREQUENCY * t)


def rates(t, state, force):
    x, v, u = state
    pull = FORCE * drive(t) ** 2 + force
    spring = STIFFNESS * x * (1 + HARDENING * x * x)
    return [v, (pull - DAMPING * v - spring) / MASS, (SENSITIVITY * x - u) / AMPLIFIER_TIME]


def main():
    of_force, of_samples = (np.random.default_rng(seed) for seed in np.random.SeedSequence(SEED).spawn(2))
    time = np.arange(SAMPLES) / RATE
    forces = np.sqrt(2 * THERMAL_ENERGY * DAMPING * RATE) * of_force.standard_normal(SAMPLES)
    states = np.empty((SAMPLES, 3))
    # At rest without a voltage, until all of it is switched on at the first sample.
    states[0] = 0.0
    for k in range(1, SAMPLES):
        over = (time[k - 1], time[k])
        solved = solve_ivp(
            rates, over, states[k - 1], "DOP853", args=(forces[k],), rtol=1e-11, atol=[1e-17, 1e-12, 1e-11]
        )
        states[k] = solved.y[:, -1]
    x, v, u = states.T
    signal = u + NOISE_SD * of_samples.standard_normal(SAMPLES)
    with open(HERE / "recording.csv", "w") as file:
        file.write("time_s,drive_V,signal_V\n")
        for row in zip(time, drive(time), signal):
            file.write("%.10g,%.7g,%.5f\n" % row)
    with open(HERE / "reference.csv", "w") as file:
        file.write("time_s,x_m,v_m_per_s\n")
        for row in zip(time, x, v):
            file.write("%.10g,%.7g,%.7g\n" % row)
    print("largest |x| %.4g m, signal within %.3g V" % (np.abs(x).max(), np.abs(signal).max()))


if __name__ == "__main__":
    main()
