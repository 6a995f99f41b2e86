"""What a step through a contact costs against one without: a switch that is pulled in, bounces and is let go, and the same that reaches no contact.

    python contact_cost.py PROGRAM

Simulated in Python by Runge and Kutta's method in 50 steps from sample to sample; shares no code with the program, which has to pass its own verdict and to
take at most 40 times as long for a step.
"""

import math
import pathlib
import random
import subprocess
import sys
import tempfile

MASS, RATE, QUALITY, GAP, PLATE = 2e-10, 251327.412, 3, 2e-6, 8.854e-12 * 2e-8
STIFF, LOSS, TRAVEL = 8000, 2e-4, 1.2e-6
NOISE, SIGNAL_SD, COUNT, INTERVAL, STEPS = 1e-3, 3e-16, 24_000, 5e-7, 50

TEXT = """name = "switch"
[device.equations]
states = { x = "m", v = "m/s" }
inputs = { drive = "V" }
interpolation = "hold"
derivative = { x = "v", v = "-w/Q*v - w^2*x + plate*drive^2/(2*m*(g - x)^2)CONTACT" }
measure = { cap = "plate/(g - x) in F" }
noise = { cap = "9e-32[F^2]", v = "1e-3[m^2/s^3]" }
parameters = { m = "2e-10 kg", w = "251327.412 rad/s", Q = "3", g = "2 um", plate = "1.7708e-19 F m" }
[[recording]]
role = "test"
file = "recording.csv"
clock = { column = "time_s" }
channels = { drive = "drive_V", cap = "cap_fF" }
[estimate]
skip = "2.4 ms"
[[estimate.filter]]
name = "EKF"
method = "ekf"
start = { x = "0 m", v = "0 m/s" }
start_sd = { x = "1 nm", v = "1 mm/s" }
"""
CONTACT = " - if(x > 1.2[um], 8000[N/m]*(x - 1.2[um]) + 2e-4[N s/m]*v, 0[N])/m"


def acceleration(x, v, volts):
    contact = STIFF * (x - TRAVEL) + LOSS * v if x > TRAVEL else 0.0
    return -RATE / QUALITY * v - RATE**2 * x + PLATE * volts**2 / (2 * MASS * (GAP - x) ** 2) - contact / MASS


def record(file, volts):
    chance, step, x, v = random.Random(3), INTERVAL / STEPS, 0.0, 0.0
    with open(file, "w", encoding="utf-8") as out:
        print("time_s,drive_V,cap_fF", file=out)
        for k in range(COUNT):
            pull = volts if k % 4000 < 2000 else 0.0
            print(f"{k * INTERVAL:.10e},{pull},{1e15 * (PLATE / (GAP - x) + SIGNAL_SD * chance.gauss(0, 1)):.9g}", file=out)
            for _ in range(STEPS):
                a = v, acceleration(x, v, pull)
                b = v + step / 2 * a[1], acceleration(x + step / 2 * a[0], v + step / 2 * a[1], pull)
                c = v + step / 2 * b[1], acceleration(x + step / 2 * b[0], v + step / 2 * b[1], pull)
                d = v + step * c[1], acceleration(x + step * c[0], v + step * c[1], pull)
                x += step / 6 * (a[0] + 2 * b[0] + 2 * c[0] + d[0])
                v += step / 6 * (a[1] + 2 * b[1] + 2 * c[1] + d[1]) + math.sqrt(NOISE * step) * chance.gauss(0, 1)


def step_s(program, volts, contact):
    """The shortest time of a step in five runs."""
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        record(folder / "recording.csv", volts)
        (folder / "experiment.toml").write_text(TEXT.replace("CONTACT", contact), encoding="utf-8")
        command = [program, "estimate", folder / "experiment.toml", "--out", folder / "out", "--force"]
        times = []
        for _ in range(5):
            said = subprocess.run(command, capture_output=True, check=True, text=True).stdout
            [line] = [line for line in said.splitlines() if line.startswith("EKF ")]
            assert "passes" in line, line
            time, unit = line.split()[-2:]
            times.append(float(time) * {"ns": 1e-9, "µs": 1e-6}[unit])
        return min(times)


def main():
    program = pathlib.Path(sys.argv[1]).resolve()
    with_contact, without = step_s(program, 22.0, CONTACT), step_s(program, 6.0, "")
    print(f"{1e6 * with_contact:.1f} µs for a step with a contact, {1e6 * without:.2f} µs without: {with_contact / without:.0f} times as long")
    assert with_contact < 40 * without


if __name__ == "__main__":
    main()
