"""What the package is made from; of no use by itself."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

__version__: str
__all__ = [
    "calibrate",
    "image",
    "spectrum",
    "batch_files",
    "estimate_many",
    "run_command",
    "check",
    "replaced",
    "to_dict",
    "to_toml",
    "Outcome",
    "estimate",
    "kalman",
    "nonlinear",
    "diagnose",
    "identify",
    "Columns",
    "simulate",
    "Stream",
    "study_check",
    "study_merge",
    "study_run",
    "__version__",
]

_Numbers = NDArray[np.float64]
_Column = tuple[str, str, int, int, NDArray[np.uint8], NDArray[np.bool_] | None]
_Recordings = Sequence[tuple[str | None, Columns]]
_Progress = Callable[[str, int, int], object] | None
_Function = tuple[int | None, Callable[..., Any] | None] | None

@final
class Columns:
    def __new__(
        cls,
        columns: Sequence[_Column],
        units: dict[str, str],
        segments: str | None = None,
        clock: str | None = None,
        rate_hz: float | None = None,
    ) -> Columns: ...
    def __len__(self) -> int: ...
    @property
    def sha256(self) -> str: ...

@final
class Outcome:
    def metrics_json(self) -> str: ...
    def notices(self) -> list[tuple[str, str]]: ...
    def not_trusted(self) -> list[str]: ...
    def tables(self) -> list[tuple[list[str], list[list[str]]]]: ...
    def summary(self) -> str: ...
    def experiment_toml(self) -> str: ...
    def sources(self) -> list[tuple[str, str, int]]: ...
    def took_s(self) -> float: ...
    def segments(self) -> list[dict[str, Any]]: ...
    def report_html(self) -> str: ...
    def figures(self) -> dict[str, bytes]: ...
    def figure_data(self) -> str: ...
    def write(self, folder: Path, trajectories: bool, force: bool) -> Path: ...

@final
class Stream:
    def __new__(cls, text: str, path: Path, state: Path | None = None) -> Stream: ...
    def feed(self, samples: bytes) -> bool: ...
    def close(self) -> None: ...
    def stop(self) -> None: ...
    def lines(self, wait: bool) -> bytes | None: ...
    def summary(self) -> str | None: ...

def check(text: str, path: Path, has_lines: bool) -> tuple[str, str | None, str]: ...
def to_toml(document: dict[str, Any]) -> str: ...
def to_dict(text: str, path: Path) -> dict[str, Any]: ...
def replaced(text: str, path: Path, changes: dict[str, Any]) -> str: ...
def estimate(
    text: str,
    path: Path,
    has_lines: bool,
    recordings: _Recordings,
    references: _Recordings,
    progress: _Progress = None,
) -> Outcome: ...
def batch_files(patterns: Sequence[str]) -> list[tuple[str, Path]]: ...
def estimate_many(
    text: str,
    path: Path,
    has_lines: bool,
    recordings: Sequence[tuple[str, Path | None, Columns | None]],
    folder: Path,
    of: str | None = None,
    reference: str | None = None,
    threads: int | None = None,
    force: bool = False,
    progress: _Progress = None,
) -> tuple[str, str, int, int, bool]: ...
def identify(
    text: str,
    path: Path,
    has_lines: bool,
    recordings: _Recordings,
    references: _Recordings,
    progress: _Progress = None,
) -> tuple[str, str, str]: ...
def diagnose(
    text: str,
    path: Path,
    has_lines: bool,
    recordings: _Recordings,
    filter: str | None = None,
    progress: _Progress = None,
) -> tuple[str, str, str | None]: ...
def calibrate(path: Path, progress: _Progress = None) -> tuple[str, str]: ...
def image(path: Path, progress: _Progress = None) -> tuple[str, str, _Numbers]: ...
def spectrum(
    path: Path, progress: _Progress = None
) -> tuple[str, str, _Numbers, _Numbers, _Numbers | None]: ...
def simulate(
    text: str, path: Path, has_lines: bool, progress: _Progress = None
) -> tuple[dict[str, _Numbers], dict[str, _Numbers], str]: ...
def kalman(
    z: _Numbers,
    f: _Numbers,
    h: _Numbers,
    q: _Numbers,
    r: _Numbers,
    x0: _Numbers,
    p0: _Numbers,
    b: _Numbers | None = None,
    u: _Numbers | None = None,
    smooth: bool = False,
) -> dict[str, _Numbers]: ...
def nonlinear(
    z: _Numbers,
    functions: Sequence[_Function],
    q: _Numbers,
    r: _Numbers,
    x0: _Numbers,
    p0: _Numbers,
    u: _Numbers | None = None,
    points: tuple[float, float, float] | None = None,
    smooth: bool = False,
) -> dict[str, _Numbers]: ...
def study_check(texts: tuple[str, str, Path]) -> tuple[str, int, int]: ...
def study_run(
    texts: tuple[str, str, Path],
    folder: Path,
    part: int,
    of: int,
    threads: int | None = None,
    progress: _Progress = None,
) -> Path: ...
def study_merge(
    texts: tuple[str, str, Path], journals: Sequence[Path], folder: Path, force: bool
) -> tuple[str, str, str, Path]: ...
def run_command(arguments: Sequence[str], owns_process: bool = False) -> int: ...
