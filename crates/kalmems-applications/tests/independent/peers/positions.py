"""The record of a real unit in 38 positions by the program and by IMU-TK, from the same samples at 100 Hz.

    python positions.py PROGRAM FOLDER_OF_IMU_TK [ITS_PROGRAM]

FOLDER_OF_IMU_TK is a copy of its repository, ITS_PROGRAM what `imu_tk.cpp` becomes (`a.out` by default). Sensitivities are codes by unit along the axis
of each sensor; that IMU-TK states scales along the axes of the unit is taken into account.
"""

import json
import pathlib
import subprocess
import sys
import tempfile

import numpy as np

# Codes by unit as the maker states them, and what is near to the codes at rest.
ACCELEROMETERS = [(415.0, -79.81), (413.0, -80.57), (415.0, -77.98)]
GYROSCOPES = [(4778.0, -6.858), (4758.0, -6.823), (4766.0, -6.816)]


def columns(name, unit, each):
    lines = [f'{axis} = {{ column = "{name}{axis}", sensitivity = "{codes} LSB/({unit})", offset = "{offset} {unit}" }}\n' for axis, (codes, offset) in zip("xyz", each)]
    return "".join(lines)


def main():
    program, folder = sys.argv[1], pathlib.Path(sys.argv[2]).resolve()
    theirs = pathlib.Path(sys.argv[3] if len(sys.argv) > 3 else "a.out").resolve()
    files = [folder / "bin/test_data" / name for name in ("xsens_acc.mat", "xsens_gyro.mat")]
    accelerometers, gyroscopes = map(np.loadtxt, files)
    rate = 1 / np.diff(accelerometers[:, 0]).mean()
    with tempfile.TemporaryDirectory() as work:
        work = pathlib.Path(work)
        samples = {f"a{axis}": accelerometers[:, 1 + k] for k, axis in enumerate("xyz")} | {f"g{axis}": gyroscopes[:, 1 + k] for k, axis in enumerate("xyz")}
        np.savez(work / "unit.npz", **samples)
        (work / "unit.toml").write_text(
            f'name = "unit"\n[sensor]\nrate = "{rate} Hz"\n[sensor.channels]\n{columns("g", "rad/s", GYROSCOPES)}[sensor.accelerometers]\n'
            f'{columns("a", "m/s^2", ACCELEROMETERS)}[positions]\nfile = "unit.npz"\ngravity = "9.81744 m/s^2"\n'
        )
        command = [program, "calibrate", "gyro", work / "unit.toml", "--out", work / "out", "--json"]
        found = json.loads(subprocess.run(command, capture_output=True, check=True).stdout)["unit_records"][0]["quantities"]
        found = {one["name"]: one for one in found}
        subprocess.run([theirs, *files], cwd=work, capture_output=True, check=True)
        for sensor in ("accelerometer", "gyroscope"):
            numbers = np.array((work / f"{sensor}.txt").read_text().split(), float)
            to_unit = numbers[:9].reshape(3, 3) @ numbers[9:18].reshape(3, 3)
            sensitivities = np.linalg.norm(np.linalg.inv(to_unit), axis=1)
            for axis, other in zip("xyz", sensitivities):
                own = found[f"{sensor}_sensitivity_{axis}"]
                expanded = own["coverage_factor"] * own["uncertainty"]
                print(f"{sensor} {axis}: {own['value']:.2f} ± {expanded:.2f} {own['unit']}, IMU-TK {other:.2f}, {(other - own['value']) / expanded:+.2f} of U")


if __name__ == "__main__":
    main()
