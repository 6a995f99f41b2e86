"""Simulates the electrothermal mirror of this folder, without kalmems: writes recording.csv and reference.csv beside itself.

    python simulate.py        (Python 3 with numpy and scipy)

A bimorph actuator is heated by the voltage V across its heater and loses its heat to a frame, and the frame to the package. Ta and Tf
are their temperatures above the package. The mirror is a resonator whose angle of rest follows the temperatures, and a
piezoresistive bridge at its hinge, which is as warm as the frame, reads its angle:

    Ca Ta' = V(t)^2/(R (1 + r Ta)) - Ga (Ta - Tf)
    Cf Tf' = Ga (Ta - Tf) - Gf Tf
    J q'' + b q' + k (q - e (Ta - c Tf)) = M(t)
    u = s (1 + d Tf) q + u0 + n Tf

M is the thermal torque of the damping, white with the two-sided density 2 kT b; it is held constant over each sampling interval
with the variance 2 kT b / interval. Recorded are V and u + noise.

Every interval is integrated by scipy's DOP853 with tolerances far below what the recording resolves. The constants below are the
truth; experiment.toml states other values for k, b, e, Ga, Gf, u0 and n, within the uncertainty that it states.
"""

from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp

INERTIA = 3.4e-15  # kg m^2: a disk of silicon, 1 mm in diameter and 30 um thick, about a diameter
STIFFNESS = INERTIA * (2 * np.pi * 483.0) ** 2  # N m/rad: 3.131e-8
DAMPING = INERTIA * 2 * np.pi * 483.0 / 40.0  # N m s/rad: a quality factor of 40, in air
BENDING = 2.06e-3  # rad/K
COMPENSATION = 0.2  # the frame's own bending, as a share of the actuator's
RESISTANCE = 500.0  # ohm
RESISTANCE_SLOPE = 3e-3  # 1/K: a platinum film
ACTUATOR_HEAT = 8e-7  # J/K: 0.8 mm x 0.25 mm x 2 um of aluminium and oxide
ACTUATOR_CONDUCTANCE = 1.03e-4  # W/K: with Ca a time constant of 7.8 ms
FRAME_HEAT = 6e-4  # J/K: 3 mm x 3 mm x 40 um of silicon
FRAME_CONDUCTANCE = 1.90e-3  # W/K: with Cf a time constant of 0.32 s
SENSITIVITY = 2.5  # V/rad
SENSITIVITY_SLOPE = -2e-3  # 1/K
OFFSET = 52e-3  # V
OFFSET_SLOPE = 3.2e-3  # V/K
THERMAL_ENERGY = 4.0453e-21  # J: kT at 293 K
NOISE_SD = 0.5e-3  # V per sample

BIAS, SLOW, FAST = 2.5, (0.8, 3.0), (0.5, 240.0)  # V, and V with Hz
RATE, SAMPLES, SEED = 10e3, 12_000, 20_264  # Hz, 1.2 s
HERE = Path(__file__).parent


def drive(t):
    (slow, slow_hz), (fast, fast_hz) = SLOW, FAST
    return BIAS + slow * np.sin(2 * np.pi * slow_hz * t) + fast * np.sin(2 * np.pi * fast_hz * t)


def rates(t, state, torque):
    angle, rate, actuator, frame = state
    power = drive(t) ** 2 / (RESISTANCE * (1 + RESISTANCE_SLOPE * actuator))
    to_frame = ACTUATOR_CONDUCTANCE * (actuator - frame)
    rest = BENDING * (actuator - COMPENSATION * frame)
    return [
        rate,
        (torque - DAMPING * rate - STIFFNESS * (angle - rest)) / INERTIA,
        (power - to_frame) / ACTUATOR_HEAT,
        (to_frame - FRAME_CONDUCTANCE * frame) / FRAME_HEAT,
    ]


def main():
    of_torque, of_samples = (np.random.default_rng(seed) for seed in np.random.SeedSequence(SEED).spawn(2))
    time = np.arange(SAMPLES) / RATE
    torques = np.sqrt(2 * THERMAL_ENERGY * DAMPING * RATE) * of_torque.standard_normal(SAMPLES)
    states = np.empty((SAMPLES, 4))
    # As warm as its package and at rest, until all of the voltage is switched on at the first sample.
    states[0] = 0.0
    for k in range(1, SAMPLES):
        over = (time[k - 1], time[k])
        solved = solve_ivp(
            rates, over, states[k - 1], "DOP853", args=(torques[k],), rtol=1e-11, atol=[1e-13, 1e-10, 1e-10, 1e-10]
        )
        states[k] = solved.y[:, -1]
    angle, rate, actuator, frame = states.T
    bridge = SENSITIVITY * (1 + SENSITIVITY_SLOPE * frame) * angle + OFFSET + OFFSET_SLOPE * frame
    signal = bridge + NOISE_SD * of_samples.standard_normal(SAMPLES)
    with open(HERE / "recording.csv", "w") as file:
        file.write("time_s,drive_V,bridge_V\n")
        for row in zip(time, drive(time), signal):
            file.write("%.10g,%.7g,%.5f\n" % row)
    with open(HERE / "reference.csv", "w") as file:
        file.write("time_s,angle_rad,T_actuator_K,T_frame_K\n")
        for row in zip(time, angle, actuator, frame):
            file.write("%.10g,%.8g,%.7g,%.7g\n" % row)
    print("largest |angle| %.4g rad, Ta %.4g K, Tf %.4g K" % tuple(np.abs(of).max() for of in (angle, actuator, frame)))


if __name__ == "__main__":
    main()
