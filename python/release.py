#!/usr/bin/env python3
"""Builds what a release of the package consists of: a wheel for each platform, the source distribution, and the prebuilt library for C.

    release.py              builds for all platforms that this machine can build for, and names the others with their reason
    release.py NAME...      builds for these alone; a platform that cannot be built is an error
    release.py --list       names the platforms and how each is built

Wheels go to `target/release_wheels`, the library for C to `target/release_library/NAME.tar.gz` with headers and descriptions for pkg-config and CMake.
Linux is built by zig as the linker (`pip install maturin ziglang`), for glibc 2.28 and musl 1.2. Windows needs the linker of MinGW, or Windows.
macOS needs a Mac, whose SDK no other machine may have. Each archive is opened again: its tag and the machine of its module are those of the platform.
Modules of other machines than this one are not run here; a release runs `pytest` with each on a machine of its kind.
"""

from __future__ import annotations

import os
import platform
import shutil
import struct
import subprocess
import sys
import tarfile
import tempfile
import zipfile
from dataclasses import dataclass
from pathlib import Path

HERE = Path(__file__).resolve().parent
WHEELS, LIBRARIES = HERE / "target/release_wheels", HERE / "target/release_library"
PROFILE = os.environ.get("KALMEMS_PROFILE", "wheel")


@dataclass(frozen=True)
class Platform:
    """A platform that a wheel is for."""

    name: str
    target: str
    tag: str
    """What the name of its wheel has in it."""
    machine: int
    """The number of its processor at the head of a module."""
    options: tuple[str, ...]
    needs: str
    """`zig`, `mingw` or the system on which alone it is built."""


ALL = [
    Platform("manylinux_x86_64", "x86_64-unknown-linux-gnu", "manylinux_2_28_x86_64", 62, ("--zig", "--compatibility", "manylinux_2_28"), "zig"),
    Platform("manylinux_aarch64", "aarch64-unknown-linux-gnu", "manylinux_2_28_aarch64", 183, ("--zig", "--compatibility", "manylinux_2_28"), "zig"),
    Platform("musllinux_x86_64", "x86_64-unknown-linux-musl", "musllinux_1_2_x86_64", 62, ("--zig", "--compatibility", "musllinux_1_2"), "zig"),
    Platform("musllinux_aarch64", "aarch64-unknown-linux-musl", "musllinux_1_2_aarch64", 183, ("--zig", "--compatibility", "musllinux_1_2"), "zig"),
    Platform("windows_x86_64", "x86_64-pc-windows-gnu", "win_amd64", 0x8664, (), "mingw"),
    Platform("macos_x86_64", "x86_64-apple-darwin", "macosx_10_12_x86_64", 0x01000007, (), "Darwin"),
    Platform("macos_arm64", "aarch64-apple-darwin", "macosx_11_0_arm64", 0x0100000C, (), "Darwin"),
]


def missing(one: Platform) -> str | None:
    """Why this machine cannot build for a platform."""
    if one.needs == "zig" and subprocess.run([sys.executable, "-m", "ziglang", "version"], capture_output=True, check=False).returncode:
        return "zig is not installed: pip install ziglang"
    if one.needs == "mingw" and platform.system() != "Windows" and not shutil.which("x86_64-w64-mingw32-gcc"):
        return "the linker of MinGW is not installed (gcc-mingw-w64-x86-64)"
    if one.needs == "Darwin" and platform.system() != "Darwin":
        return "it is built on a Mac alone"
    installed = subprocess.run(["rustup", "target", "list", "--installed"], capture_output=True, text=True, check=False).stdout.split()
    return None if one.target in installed else f"Rust has no library for it: rustup target add {one.target}"


def machine_of(module: bytes) -> int | None:
    """The number of the processor at the head of a module of Linux, Windows or macOS."""
    if module[:4] == b"\x7fELF":
        return int(struct.unpack_from("<H", module, 18)[0])
    if module[:2] == b"MZ":
        head = struct.unpack_from("<I", module, 60)[0]
        return int(struct.unpack_from("<H", module, head + 4)[0])
    if module[:4] == b"\xcf\xfa\xed\xfe":
        return int(struct.unpack_from("<I", module, 4)[0])
    return None


def check(wheel: Path, one: Platform) -> None:
    """Refuses a wheel of another platform."""
    if one.tag not in wheel.name or "-abi3-" not in wheel.name:
        sys.exit(f"{wheel.name} is not tagged abi3 and {one.tag}")
    with zipfile.ZipFile(wheel) as archive:
        if archive.testzip() is not None:
            sys.exit(f"{wheel.name} is damaged")
        modules = [name for name in archive.namelist() if name.startswith("kalmems/_kalmems.") and name.endswith((".so", ".pyd"))]
        found = [machine_of(archive.read(name)) for name in modules]
    if found != [one.machine]:
        sys.exit(f"{wheel.name} has modules for {found}; expected one for {one.machine}")


def build_wheel(one: Platform) -> Path:
    """The wheel of a platform."""
    with tempfile.TemporaryDirectory() as folder:
        program = [sys.executable, "-m", "maturin", "build", "--profile", PROFILE, "--locked", "--compression-level", "9", *one.options]
        subprocess.run([*program, "--target", one.target, "--target-dir", "target", "--out", folder], cwd=HERE, check=True)
        (made,) = Path(folder).glob("*.whl")
        check(made, one)
        WHEELS.mkdir(parents=True, exist_ok=True)
        return Path(shutil.move(made, WHEELS / made.name))


def build_library(one: Platform) -> Path | None:
    """The library for C of a platform whose linker is that of this machine; others are built on theirs."""
    if one.target != host():
        return None
    LIBRARIES.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run(["cargo", "build", "--release", "--locked"], cwd=HERE.parent / "c", check=True)
        subprocess.run([HERE.parent / "c/install.sh", folder], check=True)
        file = LIBRARIES / f"kalmems-c-{one.name}.tar.gz"
        with tarfile.open(file, "w:gz") as archive:
            archive.add(folder, arcname="kalmems")
    return file


def host() -> str:
    """The target of this machine."""
    told = subprocess.run(["rustc", "-vV"], capture_output=True, text=True, check=True).stdout
    return next(line.removeprefix("host: ") for line in told.splitlines() if line.startswith("host: "))


def main() -> None:
    names = sys.argv[1:]
    if names == ["--list"]:
        for one in ALL:
            print(f"{one.name:18} {one.target:28} {missing(one) or 'can be built here'}")
        return
    unknown = set(names) - {one.name for one in ALL}
    if unknown:
        sys.exit(f"no platform is called {', '.join(sorted(unknown))}; there are {', '.join(one.name for one in ALL)}")
    built = 0
    for one in ALL:
        if names and one.name not in names:
            continue
        why = missing(one)
        if why and names:
            sys.exit(f"{one.name}: {why}")
        if why:
            print(f"{one.name}: not built, {why}")
            continue
        wheel, library = build_wheel(one), build_library(one)
        run = "run its tests here" if one.target == host() else "not run here"
        print(f"{one.name}: {wheel.name}, {wheel.stat().st_size} bytes, {run}")
        if library:
            print(f"{one.name}: {library.name}, {library.stat().st_size} bytes")
        built += 1
    subprocess.run([sys.executable, "-m", "maturin", "sdist", "--out", WHEELS], cwd=HERE, check=True)
    if built == 0:
        sys.exit("no wheel was built")


if __name__ == "__main__":
    main()
