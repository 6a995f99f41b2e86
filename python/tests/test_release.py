"""The script of a release: it knows the machine of a module, and names what it cannot build."""

from __future__ import annotations

import re
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
import release

from kalmems import _kalmems

LINUX = next(one for one in release.ALL if one.name == "manylinux_x86_64")


def packed(folder: Path, name: str, module: bytes) -> Path:
    wheel = folder / name
    with zipfile.ZipFile(wheel, "w") as archive:
        archive.writestr("kalmems/_kalmems.abi3.so", module)
    return wheel


def test_the_machine_of_a_module_is_read_from_its_head(tmp_path: Path) -> None:
    own = Path(_kalmems.__file__).read_bytes()
    if own[:4] == b"\x7fELF" and release.host() == LINUX.target:
        assert release.machine_of(own) == LINUX.machine
    # By the published layouts of PE and Mach-O: the offset of the head at 60, the processor after four letters; the processor at 4.
    windows = b"MZ" + bytes(58) + (64).to_bytes(4, "little") + b"PE\0\0" + (0x8664).to_bytes(2, "little")
    mac = b"\xcf\xfa\xed\xfe" + (0x0100000C).to_bytes(4, "little")
    assert release.machine_of(windows) == 0x8664 and release.machine_of(mac) == 0x0100000C and release.machine_of(b"text") is None
    arm = b"\x7fELF" + bytes(14) + (183).to_bytes(2, "little")
    name = f"kalmems-0.1.0-cp310-abi3-{LINUX.tag}.whl"
    with pytest.raises(SystemExit, match=r"has modules for \[183\]; expected one for 62"):
        release.check(packed(tmp_path, name, arm), LINUX)
    with pytest.raises(SystemExit, match="is not tagged abi3 and manylinux_2_28_x86_64"):
        release.check(packed(tmp_path, "kalmems-0.1.0-cp310-abi3-linux_x86_64.whl", arm), LINUX)


def test_platforms_are_named_with_how_they_are_built() -> None:
    program = [sys.executable, release.__file__]
    listed = subprocess.run([*program, "--list"], capture_output=True, text=True, check=True).stdout
    assert len(listed.splitlines()) == len(release.ALL) == 7 and "it is built on a Mac alone" in listed or sys.platform == "darwin"
    wrong = subprocess.run([*program, "beos"], capture_output=True, text=True, check=False)
    assert wrong.returncode == 1 and "no platform is called beos" in wrong.stderr


def test_the_recipe_for_conda_is_of_this_version_and_has_the_dependencies_of_the_package() -> None:
    folder = Path(release.__file__).parent
    recipe, project = ((folder / name).read_text(encoding="utf-8") for name in ("conda/recipe.yaml", "pyproject.toml"))
    version = re.search(r'^version = "(.*)"', (folder / "Cargo.toml").read_text(encoding="utf-8"), re.MULTILINE)
    assert version is not None and f'version: "{version[1]}"' in recipe
    needed = re.search(r'^dependencies = \["numpy>=(.*)"\]', project, re.MULTILINE)
    built = re.search(r'^requires = \["maturin(.*)"\]', project, re.MULTILINE)
    assert needed is not None and f"- numpy >={needed[1]}\n" in recipe
    assert built is not None and recipe.count(f"- maturin {built[1]}\n") == 2


def test_the_build_says_on_the_terminal_that_it_compiles(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    maturin = pytest.importorskip("maturin")
    import build_backend

    for hook in ("get_requires_for_build_wheel", "prepare_metadata_for_build_wheel", "build_sdist"):
        assert getattr(build_backend, hook) is getattr(maturin, hook)
    terminal = tmp_path / "terminal"
    terminal.touch()
    lines = []

    def build(folder: str) -> str:
        lines.append(terminal.read_text())
        return f"{folder}/wheel"

    monkeypatch.setattr(build_backend, "TERMINAL", str(terminal))
    assert build_backend.told(build)("here") == "here/wheel"
    assert "compiling Rust" in lines[0] and "compiled in 0.0 minutes" in terminal.read_text()
    monkeypatch.setattr(build_backend, "TERMINAL", str(tmp_path / "none/terminal"))
    assert build_backend.told(build)("here") == "here/wheel"
