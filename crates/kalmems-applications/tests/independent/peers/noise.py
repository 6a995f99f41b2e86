"""Three hours of a gyroscope at rest by the program, imu_utils and allan_variance_ros, from the same samples at 100 Hz: what each finds of what was put in.

    python noise.py PROGRAM IMU_UTILS ALLAN FOLDER_OF_ALLAN [RECORDS]

IMU_UTILS and ALLAN are what `imu_utils.cpp` and `allan_variance_ros.cpp` become, FOLDER_OF_ALLAN is a copy of the latter's repository, whose
`scripts/analysis.py` fits. Sizes are in rad and s; of an interval it is counted how often it holds what was put in.
"""

import json
import pathlib
import re
import subprocess
import sys
import tempfile

import numpy as np

RATE, COUNT = 100.0, 1_080_000
PUT_IN = {"angle_random_walk": 2e-4, "bias_instability": 3e-5, "rate_random_walk": 2e-6}


def record(seed):
    random, (walk, flicker, rate_walk) = np.random.default_rng(seed), PUT_IN.values()
    longer = 4 * COUNT
    frequency = np.fft.rfftfreq(longer, 1 / RATE)
    density = np.zeros_like(frequency)
    density[1:] = flicker**2 / (2 * np.pi * frequency[1:])
    parts = random.standard_normal((2, len(frequency)))
    rate = np.fft.irfft((parts[0] + 1j * parts[1]) * np.sqrt(density * longer * RATE / 2), longer)[COUNT : 2 * COUNT]
    rate += walk * np.sqrt(RATE) * random.standard_normal(COUNT)
    return rate + rate_walk / np.sqrt(RATE) * np.cumsum(random.standard_normal(COUNT))


def run(*command, **options):
    return subprocess.run(list(map(str, command)), capture_output=True, text=True, check=True, **options).stdout


def main():
    program, imu_utils, allan, folder = sys.argv[1:5]
    records = int(sys.argv[5]) if len(sys.argv) > 5 else 10
    held, found = dict.fromkeys(PUT_IN, 0), {}
    with tempfile.TemporaryDirectory() as work:
        work = pathlib.Path(work)
        (work / "allan.yaml").write_text("imu_topic: imu\nimu_rate: 100\nmeasure_rate: 100\nsequence_time: 20000\n")
        (work / "rest.toml").write_text(
            f'name = "rest"\n[sensor]\nrate = "{RATE} Hz"\nchannels = {{ y = "rate_rad_per_s" }}\n[rest]\nfile = "rest.npy"\n'
            f'format = {{ kind = "npy", columns = ["rate_rad_per_s"] }}\nclock = {{ rate = "{RATE} Hz" }}\n'
        )
        for seed in range(records):
            rate = record(seed)
            rate.tofile(work / "rest.bin")
            np.save(work / "rest.npy", rate)
            rest = json.loads(run(program, "calibrate", "gyro", work / "rest.toml", "--out", work / "out", "--force", "--json"))["rest"][0]
            for term, size in PUT_IN.items():
                low, high = rest[f"{term}_interval"]
                held[term] += low <= size <= high
                point = rest[term][0] if term == "bias_instability" and rest[term] else rest[term]
                found.setdefault(("kalmems", term), []).append((point or 0.0) / size)
            white, lowest = map(float, re.search(r"found (\S+) (\S+)", run(imu_utils, work / "rest.bin", RATE)).groups())
            found.setdefault(("imu_utils", "angle_random_walk"), []).append(white / PUT_IN["angle_random_walk"])
            found.setdefault(("imu_utils", "bias_instability"), []).append(lowest / 0.664 / PUT_IN["bias_instability"])
            run(allan, work / "allan.yaml", work, work / "rest.bin")
            script = pathlib.Path(folder).resolve() / "scripts/analysis.py"
            run(sys.executable, script, "--data", "allan_variance.csv", "--config", "allan.yaml", cwd=work)
            yaml = (work / "imu.yaml").read_text()
            for key, term in (("noise_density", "angle_random_walk"), ("random_walk", "rate_random_walk")):
                size = float(re.search(rf"gyroscope_{key}: [^0-9]*([0-9]\S*?)\)? *\n", yaml.replace("float64", "")).group(1))
                found.setdefault(("allan_variance_ros", term), []).append(size / PUT_IN[term])
    print("found of what was put in, lowest, median, highest:")
    for (who, term), ratios in found.items():
        print(f"{who:20} {term:20} {min(ratios):.3f} {np.median(ratios):.3f} {max(ratios):.3f}")
    print(f"in the intervals of kalmems, of {records}: {held}")


if __name__ == "__main__":
    main()
