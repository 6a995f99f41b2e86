"""maturin as a build backend that says on the terminal what takes so long: `pip install` shows nothing of a build until it ends.

All hooks are those of maturin.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from typing import Any

import maturin
from maturin import (  # noqa: F401 - hooks that pip looks for here
    build_sdist,
    get_requires_for_build_editable,
    get_requires_for_build_sdist,
    get_requires_for_build_wheel,
    prepare_metadata_for_build_editable,
    prepare_metadata_for_build_wheel,
)

TERMINAL = "CONOUT$" if sys.platform == "win32" else "/dev/tty"


def tell(text: str) -> None:
    """Writes a line to the terminal, if there is one."""
    try:
        with open(TERMINAL, "w", encoding="utf-8") as terminal:
            terminal.write(f"\nkalmems: {text}\n")
    except OSError:
        pass


def told(build: Callable[..., str]) -> Callable[..., str]:
    """The same hook, with its beginning and its end on the terminal."""

    def hook(*given: Any, **named: Any) -> str:
        started = time.monotonic()
        tell("compiling Rust, which takes 5 to 30 minutes depending on the processor; `pip install -v` shows its progress")
        file = build(*given, **named)
        tell(f"compiled in {(time.monotonic() - started) / 60:.1f} minutes")
        return file

    return hook


build_wheel = told(maturin.build_wheel)
build_editable = told(maturin.build_editable)
