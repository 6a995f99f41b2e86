#!/usr/bin/env python3
"""A day of samples at 10 kHz through `kalmems stream`, as fast as it takes them: is its memory constant, and do its times and phases drift?

    tools/stream_day.py target/release/kalmems [--seconds 86400]

A resonator of 305 Hz, driven at 300 Hz, whose motion is known; its samples come as frames with a time and a counter, and one estimate in a second is written.
The noise of a second begins anywhere in a longer noise, with either sign, so that each estimate has another error. Printed are the memory in each
tenth, the time of the last estimate beside that of its sample, the rate at which samples were taken, and the errors of the estimates in standard
deviations: mean and rms of all, and the rms of the first and of the last tenth. Standard library alone; the exit code is 1 where one of these is not
as it should be."""

import argparse
import math
import random
import subprocess
import sys
import tempfile
import time
from array import array
from pathlib import Path

RATE = 10_000
DRIVE_HZ, FREE_HZ, QUALITY, FORCE, NOISE_V = 300.0, 305.0, 50.0, 1e3, 0.01
EXPERIMENT = f"""
name = "day"
[device.equations]
states = {{ x = "um", v = "um/s" }}
inputs = {{ drive = "V" }}
derivative = {{ x = "v", v = "force*drive - w0/quality*v - w0^2*x" }}
measure = {{ signal = "gain*x in V" }}
noise = {{ signal = "{NOISE_V**2}[V^2]", v = "1e4[um^2/s^3]" }}
[device.equations.parameters]
w0 = "{2 * math.pi * FREE_HZ!r} rad/s"
quality = {QUALITY}
force = "{FORCE} um/s^2/V"
gain = "1 V/um"
[[recording]]
role = "test"
file = "none.csv"
clock = {{ column = "time_s" }}
channels = {{ drive = "drive_V", signal = "signal_V" }}
[stream]
rate = "10 kHz"
every = {RATE}
[stream.input.frames]
sync = "a55a"
fields = ["u16 sequence", "f64 time_s", "f32 drive_V", "f32 signal_V"]
[estimate]
skip = "0.5 s"
[[estimate.filter]]
name = "EKF"
method = "ekf"
start = {{ x = "0 um", v = "0 um/s" }}
start_sd = {{ x = "1 um", v = "1e3 um/s" }}
"""
LENGTH = 2 + 2 + 8 + 4 + 4
# Samples after which drive and motion repeat, and of how many a second's noise is chosen.
PERIOD, NOISE = 100, 2_000_000
COUNTS = array("H", (k & 0xFFFF for k in range(0x10000 + RATE))).tobytes()


def motion(time_s):
    """The steady motion in um, by the response of a linear resonator."""
    w, w0 = 2 * math.pi * DRIVE_HZ, 2 * math.pi * FREE_HZ
    gain = FORCE / complex(w0 * w0 - w * w, w * w0 / QUALITY)
    angle = 2 * math.pi * math.fmod(DRIVE_HZ * time_s, 1.0)
    return gain.real * math.cos(angle) - gain.imag * math.sin(angle)


def frames_of_a_second():
    """The frames of a second, without counter, time and signal."""
    frames = bytearray(RATE * LENGTH)
    drive = array("f", (math.cos(2 * math.pi * DRIVE_HZ * k / RATE) for k in range(RATE))).tobytes()
    frames[0::LENGTH], frames[1::LENGTH] = b"\xa5" * RATE, b"\x5a" * RATE
    for byte in range(4):
        frames[12 + byte :: LENGTH] = drive[byte::4]
    return frames


def signals(chance):
    """The signal with each sign of the noise: of all its samples the first bytes, then the second ones, and so on."""
    moved = [motion(k / RATE) for k in range(PERIOD)]
    noise = [chance.gauss(0, NOISE_V) for _ in range(NOISE)]
    bytes_of = lambda sign: array("f", (moved[k % PERIOD] + sign * noise[k] for k in range(NOISE))).tobytes()
    return [[whole[byte::4] for byte in range(4)] for whole in (bytes_of(1), bytes_of(-1))]


def put_signal(frames, signal, chance):
    first = PERIOD * chance.randrange((NOISE - RATE) // PERIOD + 1)
    for byte in range(4):
        frames[16 + byte :: LENGTH] = signal[byte][first : first + RATE]


def stamp(frames, number):
    """Puts counter and time into the frames of the second of this number."""
    first = number * RATE
    from_count = 2 * (first & 0xFFFF)
    count = COUNTS[from_count : from_count + 2 * RATE]
    times_s = array("d", [k / RATE for k in range(first, first + RATE)]).tobytes()
    for byte in range(2):
        frames[2 + byte :: LENGTH] = count[byte::2]
    for byte in range(8):
        frames[4 + byte :: LENGTH] = times_s[byte::8]


def resident_kib(process):
    lines = Path(f"/proc/{process.pid}/status").read_text().split("\n")
    return next(int(line.split()[1]) for line in lines if line.startswith("VmRSS:"))


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("kalmems", type=Path)
    arguments.add_argument("--seconds", type=int, default=86_400)
    given = arguments.parse_args()
    sys.byteorder == "little" or sys.exit("the frames are written on machines that are little-endian alone")
    with tempfile.TemporaryDirectory() as folder:
        experiment, lines = Path(folder, "day.toml"), Path(folder, "lines.txt")
        experiment.write_text(EXPERIMENT)
        command = [str(given.kalmems.resolve()), "stream", str(experiment), "--lines", str(lines)]
        process = subprocess.Popen(command, stdin=subprocess.PIPE, stderr=subprocess.PIPE)
        chance = random.Random(1)
        frames, both, memory = frames_of_a_second(), signals(chance), []
        begun = time.monotonic()
        for number in range(given.seconds):
            stamp(frames, number)
            put_signal(frames, chance.choice(both), chance)
            process.stdin.write(frames)
            if (number + 1) % max(given.seconds // 10, 1) == 0:
                memory.append(resident_kib(process))
                print(f"{number + 1} s: {memory[-1]} KiB", flush=True)
        process.stdin.close()
        said = process.stderr.read().decode()
        code = process.wait()
        taken_hz = given.seconds * RATE / (time.monotonic() - begun)
        rows = [line.split(",") for line in lines.read_text().split("\n") if line.startswith("ekf,")]
    print(said.strip())
    estimates = [(float(row[1]), float(row[2]) * 1e6, float(row[3]) * 1e6) for row in rows if row[2]]
    errors = [(x - motion(time_s)) / sd for time_s, x, sd in estimates if time_s > 1]
    tenth = max(len(errors) // 10, 1)
    rms = lambda values: math.sqrt(sum(value * value for value in values) / len(values))
    early, late, whole, mean = rms(errors[:tenth]), rms(errors[-tenth:]), rms(errors), sum(errors) / len(errors)
    last_s = (given.seconds - 1) * 1.0
    print(f"exit code {code}; the last estimate at {estimates[-1][0]!r} s of {last_s!r} s; {taken_hz:.3g} samples in a second")
    print(f"errors of {len(errors)} estimates in standard deviations: mean {mean:.3f}, rms {whole:.2f}, {early:.2f} in the first tenth, {late:.2f} in the last")
    # The logarithm of an rms of n errors has the variance 1/(2·n): four standard deviations are exceeded once in 30 000 times.
    has_drifted = late > early * math.exp(4 / math.sqrt(tenth))
    is_right = code == 0 and estimates[-1][0] == last_s and not has_drifted and memory[-1] < memory[0] + 8192
    # The process noise of the filter, which the motion has not, takes as much of its claim as the noise of the signal: the rms is 1/√2 if the ring-down is long.
    is_right = is_right and 0.5 < whole < 0.9 and abs(mean) < 5 * whole / math.sqrt(len(errors))
    return 0 if is_right else 1


if __name__ == "__main__":
    sys.exit(main())
