"""Simulates the vibrating gyroscope of this folder, without kalmems: writes recording.csv and reference.csv beside itself.

    python simulate.py        (Python 3 with numpy and scipy)

A proof mass that is driven along x and read along x and y, in a frame that turns by the rate W(t):

    m x'' + bx x' + kx x + kxy y = g V(t) + 2 m W y' + Fx(t)
    m y'' + by y' + ky y + kxy x = -2 m W x' + Fy(t)

kxy, the quadrature, is what an imperfect suspension couples. The terms with W^2 and W' are left out: beside the Coriolis terms
they are smaller by W/(2 w) = 1e-5 and by W'/(2 W w) = 1e-3, and the latter are in phase with the quadrature.

W is a Gauss-Markov process of second order, critically damped, drawn exactly at the samples and a cubic between them:

    W'' + 2 u W' + u^2 W = white noise of the two-sided density 4 u^3 rms^2

Fx and Fy are the thermal forces of the dampings, white with the two-sided densities 2 kT b; each is held constant over a sampling
interval with the variance 2 kT b / interval. Recorded are V and both pick-offs, sx x and sy y, each with noise of its own.

Every interval is integrated by scipy's DOP853 with tolerances far below what the recording resolves. The constants below are the
truth; experiment.toml states other values for kx, ky, kxy, bx, by and g, within the uncertainty that it states.
"""

from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicHermiteSpline
from scipy.linalg import expm

MASS = 1e-8  # kg: 0.6 mm x 0.6 mm x 12 um of silicon
STIFFNESS_X = MASS * (2 * np.pi * 10_000.0) ** 2  # N/m: 39.478
STIFFNESS_Y = MASS * (2 * np.pi * 10_247.0) ** 2  # N/m: 41.453
DAMPING_X = MASS * 2 * np.pi * 10_000.0 / 5000.0  # N s/m: a quality factor of 5000
DAMPING_Y = MASS * 2 * np.pi * 10_247.0 / 1000.0  # N s/m: a quality factor of 1000
QUADRATURE = 6.6e-3  # N/m: as a rate kxy/(2 m w) = 5.25 rad/s = 301 deg/s
FORCE = 4.0e-8  # N/V
SENSITIVITY_X = 0.2e6  # V/m
SENSITIVITY_Y = 10e6  # V/m
THERMAL_ENERGY = 4.0453e-21  # J: kT at 293 K
NOISE_SD_X = 1e-3  # V per sample: 5 nm
NOISE_SD_Y = 0.3e-3  # V per sample: 30 pm
RATE_RMS = 1.0  # rad/s: 57 deg/s
RATE_BANDWIDTH = 2 * np.pi * 20.0  # rad/s: u

AMPLITUDE, FREQUENCY = 1.0, 10_000.3  # V, Hz
RATE, SAMPLES, SEED = 200e3, 12_000, 20_263  # Hz, 60 ms
DRIVEN_BEFORE = 0.1  # s: how long the drive is on before the first sample, from rest
HERE = Path(__file__).parent


def drive(t):
    return AMPLITUDE * np.sin(2 * np.pi * FREQUENCY * t)


def matrix(turning):
    """A of the state's rates A (x, v, y, w)."""
    coriolis = 2 * MASS * turning
    return np.array([
        [0, 1, 0, 0],
        [-STIFFNESS_X / MASS, -DAMPING_X / MASS, -QUADRATURE / MASS, coriolis / MASS],
        [0, 0, 0, 1],
        [-QUADRATURE / MASS, -coriolis / MASS, -STIFFNESS_Y / MASS, -DAMPING_Y / MASS],
    ])


def rates(t, state, turning, forces):
    x, v, y, w = state
    coriolis = 2 * MASS * turning(t)
    pull_x = FORCE * drive(t) + forces[0] + coriolis * w
    pull_y = forces[1] - coriolis * v
    return [
        v,
        (pull_x - DAMPING_X * v - STIFFNESS_X * x - QUADRATURE * y) / MASS,
        w,
        (pull_y - DAMPING_Y * w - STIFFNESS_Y * y - QUADRATURE * x) / MASS,
    ]


def gauss_markov(normal):
    """W and W' at the samples."""
    u, h = RATE_BANDWIDTH, 1 / RATE
    flow = expm(np.array([[0, 1], [-u * u, -2 * u]]) * h)
    stationary = RATE_RMS**2 * np.diag([1, u * u])
    added = np.linalg.cholesky(stationary - flow @ stationary @ flow.T)
    process = np.empty((SAMPLES, 2))
    process[0] = np.sqrt(np.diag(stationary)) * normal.standard_normal(2)
    for k in range(1, SAMPLES):
        process[k] = flow @ process[k - 1] + added @ normal.standard_normal(2)
    return process


def at_first_sample(turning):
    """The state after the drive was on for a while at this rate, from rest."""
    a = matrix(turning)
    force = [0, FORCE * AMPLITUDE / MASS, 0, 0]
    response = np.linalg.solve(2j * np.pi * FREQUENCY * np.eye(4) - a, force)
    steady = lambda t: np.imag(response * np.exp(2j * np.pi * FREQUENCY * t))
    return steady(0.0) - expm(a * DRIVEN_BEFORE) @ steady(-DRIVEN_BEFORE)


def main():
    of_x, of_y, of_rate, of_samples = (
        np.random.default_rng(seed) for seed in np.random.SeedSequence(SEED).spawn(4)
    )
    time = np.arange(SAMPLES) / RATE
    turning, its_rate = gauss_markov(of_rate).T
    turning_at = CubicHermiteSpline(time, turning, its_rate)
    forces = np.sqrt(2 * THERMAL_ENERGY * RATE * np.array([[DAMPING_X], [DAMPING_Y]]))
    forces = forces * np.stack([of_x.standard_normal(SAMPLES), of_y.standard_normal(SAMPLES)])
    states = np.empty((SAMPLES, 4))
    states[0] = at_first_sample(turning[0])
    for k in range(1, SAMPLES):
        solved = solve_ivp(
            rates,
            (time[k - 1], time[k]),
            states[k - 1],
            "DOP853",
            args=(turning_at, forces[:, k]),
            rtol=1e-11,
            atol=[1e-17, 1e-12, 1e-18, 1e-13],
        )
        states[k] = solved.y[:, -1]
    x, v, y, w = states.T
    noise = of_samples.standard_normal((2, SAMPLES))
    along_x = SENSITIVITY_X * x + NOISE_SD_X * noise[0]
    along_y = SENSITIVITY_Y * y + NOISE_SD_Y * noise[1]
    with open(HERE / "recording.csv", "w") as file:
        file.write("time_s,drive_V,drive_pickoff_V,sense_pickoff_V\n")
        for row in zip(time, drive(time), along_x, along_y):
            file.write("%.10g,%.7f,%.6f,%.6f\n" % row)
    with open(HERE / "reference.csv", "w") as file:
        file.write("time_s,Omega_rad_per_s,x_m,y_m\n")
        for row in zip(time, turning, x, y):
            file.write("%.10g,%.7g,%.7g,%.7g\n" % row)
    largest = [np.abs(of).max() for of in (x, y, turning)]
    print("largest |x| %.4g m, |y| %.4g m, |rate| %.4g rad/s" % tuple(largest))


if __name__ == "__main__":
    main()
