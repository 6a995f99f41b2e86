"""Deviations of a long record at rest by the program and by allantools, from the same file: their differences, times and memory.

    python octaves.py PROGRAM [SAMPLES]

Needs NumPy and allantools 2024.6. Each program is a process of its own, which is measured with all it does: reading the file, too.
"""

import json
import pathlib
import subprocess
import sys
import tempfile

import numpy as np

OWN, OTHERS = ["allan", "modified", "hadamard", "total"], ["oadev", "mdev", "ohdev", "totdev"]
# Up to so many samples each difference is formed; beyond, one from each eighth, sixteenth, ... sample.
EXACT = 1 << 17
ALLANTOOLS = """
import sys, json, numpy, allantools
rate = numpy.load(sys.argv[1])
factors = [2**k for k in range(int(sys.argv[3]))]
found = getattr(allantools, sys.argv[2])(rate, rate=1.0, data_type="freq", taus=factors)
print(json.dumps(dict(zip(map(int, found[0]), map(float, found[1])))))
"""
MEASURE = """
import json, resource, subprocess, sys
done = subprocess.run(sys.argv[1:], capture_output=True, text=True)
assert done.returncode == 0, done.stderr
used = resource.getrusage(resource.RUSAGE_CHILDREN)
print(json.dumps([used.ru_utime + used.ru_stime, used.ru_maxrss * 1024, done.stdout]))
"""


def measured(*command):
    """Seconds of processor time, bytes of memory and what was printed."""
    return json.loads(subprocess.run([sys.executable, "-c", MEASURE, *map(str, command)], capture_output=True, text=True, check=True).stdout)


def main():
    program, samples = sys.argv[1], int(float(sys.argv[2])) if len(sys.argv) > 2 else 10**8
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        np.save(folder / "rest.npy", 1e-3 * np.random.default_rng(1).standard_normal(samples))
        (folder / "rest.toml").write_text(
            'name = "rest"\n[sensor]\nrate = "1 Hz"\nchannels = { y = "rate_rad_per_s" }\n[rest]\nfile = "rest.npy"\n'
            'format = { kind = "npy", columns = ["rate_rad_per_s"] }\nclock = { rate = "1 Hz" }\n'
        )
        own_s, own_bytes, printed = measured(program, "calibrate", "gyro", folder / "rest.toml", "--out", folder / "out", "--json")
        rest = json.loads(printed)["rest"][0]
        print(f"kalmems calibrate, the whole command: {own_s:.1f} s of processor time, {own_bytes / 1e6:.0f} MB", flush=True)
        taken_s = 0.0
        for own, other in zip(OWN, OTHERS):
            found = {int(time_s): deviation for time_s, deviation, *_ in rest[own]}
            script = [sys.executable, "-c", ALLANTOOLS, folder / "rest.npy", other, len(found)]
            other_s, other_bytes, printed = measured(*script)
            taken_s += other_s
            theirs = {int(time_s): deviation for time_s, deviation in json.loads(printed).items()}
            assert set(theirs) >= set(found), (own, sorted(found), sorted(theirs))
            off = {time_s: abs(deviation / theirs[time_s] - 1) for time_s, deviation in found.items()}
            exact, beyond = ([value for time_s, value in off.items() if (time_s <= EXACT) == is_exact] for is_exact in (True, False))
            print(
                f"{own} and {other}: to {max(exact):.1e} up to {EXACT} samples, to {max(beyond, default=0):.1e} beyond; "
                f"{other} alone {other_s:.1f} s, {other_bytes / 1e6:.0f} MB",
                flush=True,
            )
            assert max(exact) < 1e-9, off
        print(f"allantools takes {taken_s / own_s:.1f} times as long for the four")
        assert samples < 10**8 or (own_bytes < 100e6 and taken_s > 5 * own_s), (own_s, own_bytes, taken_s)


if __name__ == "__main__":
    main()
