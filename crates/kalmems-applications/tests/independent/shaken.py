"""How often the intervals of a calibration under vibration hold what NumPy put in: shares no code with the program, whose result it reads as JSON.

    python shaken.py PROGRAM [SEEDS]

A gyroscope and a table each have their own clock and their own start. All scale factors of a record are off by the same part, which differs from record
to record. Each number has to be in its interval for 91 to 99 of 100 seeds, and all numbers together in 94 to 97 %.
"""

import json
import pathlib
import subprocess
import sys
import tempfile

import numpy as np

MATRIX = np.array([[1.013, 0.004, -0.006], [-0.003, 0.991, 0.005], [0.007, -0.002, 1.021]])
AXES = "xyz"
# How far the gyroscope's clock is off, its noise and that of the table by one sample, and the scatter of the records.
CLOCK, NOISE, OF_TABLE, SCATTER = 3e-3, 2e-3, 2e-4, 3e-4
SAMPLES, GYROSCOPE_HZ, TABLE_HZ = 900, 1000.0, 2000.0
DIRECTIONS = np.array([[1, 0.5, 0.2], [-0.4, 1, 0.3], [0.3, -0.2, 1], [0.7, 0.7, -0.5]])
# Conditions of one calibration file, each with random numbers of its own.
TOGETHER = 10

ONE, BY_FREQUENCY, ALL = "one axis, four records", "by frequency, four records each", "nine entries, 24 records"
# The rates about the three axes and the frequencies of the records.
KINDS = {
    ONE: [([0, 1, 0], 47.0)] * 4,
    BY_FREQUENCY: [([0, 1, 0], frequency) for frequency in (31.0, 53.0, 71.0, 97.0, 113.0) for _ in range(4)],
    ALL: [(DIRECTIONS[k % 4], 47.0) for k in range(24)],
}


def factor(kind, frequency):
    """What the scale factors are multiplied by: a low pass of 300 Hz if they depend on the frequency."""
    return 1 / np.hypot(1, frequency / 300) if kind == BY_FREQUENCY else 1.0


def write(path, names, records, digits):
    with open(path, "w", encoding="utf-8") as file:
        file.write(",".join(["record", *names]) + "\n")
        for number, samples in enumerate(records):
            for row in samples:
                file.write(f"r{number}," + ",".join(f"{value:.{digits}f}" for value in row) + "\n")


def condition(folder, kind, seed):
    """Writes the records of one condition, and returns its part of the calibration file."""
    random = np.random.default_rng(seed)
    shown, known = [], []
    for rates, frequency in KINDS[kind]:
        gain = factor(kind, frequency) * (1 + SCATTER * random.standard_normal())
        starts = random.uniform(0, 2 * np.pi, 2)
        at = [np.arange(SAMPLES) / (GYROSCOPE_HZ * (1 + CLOCK)), np.arange(SAMPLES) / TABLE_HZ]
        sines = [np.cos(2 * np.pi * frequency * time + start)[:, None] for time, start in zip(at, starts)]
        own = gain * sines[0] * (MATRIX @ rates) + NOISE * random.standard_normal((SAMPLES, 3))
        shown.append(own + np.array([0.02, -0.01, 0.03]))
        known.append(sines[1] * np.asarray(rates) + OF_TABLE * random.standard_normal((SAMPLES, 3)))
    write(folder / f"g{seed}.csv", [f"g{axis}_rad_per_s" for axis in AXES], shown, 7)
    write(folder / f"t{seed}.csv", [f"t{axis}_rad_per_s" for axis in AXES], known, 8)
    columns = ", ".join(f'{axis} = "t{axis}_rad_per_s"' for axis in AXES)
    return (
        f'[[condition]]\nname = "s{seed}"\nfile = "g{seed}.csv"\nsegments = {{ column = "record" }}\n'
        f'[[condition.reference]]\nname = "table"\nfile = "t{seed}.csv"\nsegments = {{ column = "record" }}\n'
        f'clock = {{ rate = "{TABLE_HZ} Hz" }}\nchannels = {{ {columns} }}\n'
    )


def calibrated(program, folder, kind, seeds):
    """What the program finds in the conditions of these seeds."""
    columns = ", ".join(f'{axis} = "g{axis}_rad_per_s"' for axis in AXES)
    head = f'name = "shaken"\n[sensor]\nrate = "{GYROSCOPE_HZ} Hz"\nclock_tolerance = "1 %"\nchannels = {{ {columns} }}\n'
    (folder / "shaken.toml").write_text(head + "".join(condition(folder, kind, seed) for seed in seeds))
    command = [program, "calibrate", "gyro", folder / "shaken.toml", "--out", folder / "out", "--force", "--json"]
    # The program exits with 1 if a scale factor is withheld, as it has to be here by frequency.
    return json.loads(subprocess.run(command, capture_output=True, check=False).stdout)["results"]


def numbers(kind, result):
    """The numbers of one condition by name: what was found, and what was put in."""
    if kind == BY_FREQUENCY:
        assert len(result["by_frequency"]) == 5, result.get("withheld")
        for at in result["by_frequency"]:
            found = at["scale_factor"] if "scale_factor" in at else at
            frequency = round(at["frequency_hz"])
            yield f"{frequency} Hz", found, factor(kind, frequency) * MATRIX[1, 1]
        return
    assert "withheld" not in result, result["withheld"]
    for i, j in np.ndindex(3, 3):
        if kind == ALL or (i, j) == (1, 1):
            yield f"k_{AXES[i]}{AXES[j]}", result["matrix"][i][j], MATRIX[i, j]


def main():
    program, seeds = sys.argv[1], int(sys.argv[2]) if len(sys.argv) > 2 else 400
    assert seeds >= 100 and seeds % TOGETHER == 0, "fewer than 100 seeds, or none of ten"
    outside = []
    for number, kind in enumerate(KINDS):
        held = {}
        for first in range(0, seeds, TOGETHER):
            chosen = range(10_000 * number + first, 10_000 * number + first + TOGETHER)
            with tempfile.TemporaryDirectory() as folder:
                results = calibrated(program, pathlib.Path(folder), kind, chosen)
            assert len(results) == TOGETHER
            for result in results:
                for name, found, put_in in numbers(kind, result):
                    low, high = found["interval"]
                    assert low < found["value"] < high, (kind, name, found)
                    held[name] = held.get(name, 0) + int(low <= put_in <= high)
        pooled = 100 * sum(held.values()) / (len(held) * seeds)
        print(f"{kind}: {held} of {seeds}, {pooled:.1f} %", flush=True)
        outside += [(kind, name, count) for name, count in held.items() if not 91 <= 100 * count / seeds <= 99]
        outside += [] if 94 <= pooled <= 97 else [(kind, "all", pooled)]
    assert not outside, outside


if __name__ == "__main__":
    main()
