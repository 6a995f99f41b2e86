# Written by `stubs.py` from the signatures in `src`.
"""
What the package `kalmems` is made from.
"""
from _typeshed import SupportsGetItem
from os import PathLike
from pathlib import Path
from typing import Final, SupportsFloat, SupportsIndex, final
from collections.abc import Callable, Sequence
from typing import Any
import numpy as np
from numpy.typing import NDArray
_Numbers = NDArray[np.float64]
_Column = tuple[str, str, int, int, NDArray[np.uint8], NDArray[np.bool_] | None]
_Progress = Callable[[str, int, int], object] | None
_Function = tuple[int | None, Callable[..., Any] | None] | None
__all__ = ['__version__', 'Columns', 'Equations', 'Outcome', 'Stream', 'batch_files', 'calibrate', 'check', 'diagnose', 'estimate', 'estimate_many', 'identify', 'image', 'innovation_tests', 'kalman', 'nonlinear', 'replaced', 'run_command', 'simulate', 'spectrum', 'study_check', 'study_merge', 'study_run', 'to_dict', 'to_toml']
__version__: Final[str]

@final
class Columns:
    """
    The columns of a recording, which nobody can change any more.
    """

    def __len__(self, /) -> int:
        """
        How many samples there are.
        """

    def __new__(cls, /, columns: Sequence[_Column], units: dict[str, str], segments: str | None=None, clock: str | None=None, rate_hz: SupportsFloat | SupportsIndex | None=None) -> Columns:
        """
        Columns with what is said of them: units by the column, the column of the segments' labels, the column of the times or the rate
        in Hz.
        """

    @property
    def sha256(self, /) -> str:
        """
        SHA-256 of names, types and numbers.
        """

@final
class Equations:
    """
    Equations with values of their parameters, and what leads them over an interval.
    """

    def __new__(cls, /, text: str, values: Sequence[tuple[str, float]], interval_s: float, steps: int) -> Equations:
        """
        Reads equations, with other values in SI of some parameters, for steps of this interval in s.
        """

    def measure(self, /, x: _Numbers, u: _Numbers) -> tuple[_Numbers, _Numbers]:
        """
        What is measured at a state under inputs, and its derivatives by the state row after row.
        """

    def names(self, /) -> tuple[list[tuple[str, str]], list[tuple[str, str]], list[tuple[str, str]], list[tuple[str, str]]]:
        """
        The states, inputs and measurements with their units, and the parameters with theirs.
        """

    def noise(self, /, x: _Numbers, interval_s: float) -> tuple[_Numbers, _Numbers]:
        """
        The power densities of the rates of the states, and the variances of a sample of the measurements at an interval in s, at a state.
        """

    def step(self, /, x: _Numbers, u: _Numbers) -> tuple[_Numbers, _Numbers]:
        """
        The state after the interval, and its derivatives by the state row after row; not numbers where the equations have none.
        """

    def values(self, /) -> _Numbers:
        """
        The values of the parameters in SI.
        """

@final
class Outcome:
    """
    What came of an experiment; its arrays are views of what is held here.
    """

    def answers(self, /) -> list[str]:
        """
        The motion and how well it is known, a sentence for each quantity.
        """

    def experiment_toml(self, /) -> str:
        """
        The experiment as it was understood, every default written out.
        """

    def figure_data(self, /) -> str:
        """
        The pictures of the report as data, which another program can draw.
        """

    def figures(self, /) -> dict[str, bytes]:
        """
        The pictures of the report by their names, as SVG.
        """

    def metrics_json(self, /) -> str:
        """
        The figures, as `metrics.json` has them.
        """

    def not_trusted(self, /) -> list[str]:
        """
        The filters whose answers cannot be trusted.
        """

    def notices(self, /) -> list[tuple[str, str]]:
        """
        What a reader must know before trusting a figure: how serious it is, and the sentence.
        """

    def report_html(self, /) -> str:
        """
        The report as a page of HTML.
        """

    def segments(self, /) -> list[dict[str, Any]]:
        """
        The segments with their trajectories, as dictionaries; see `kalmems._result`.
        """

    def sources(self, /) -> list[tuple[str, str, int]]:
        """
        What was read: file, SHA-256 and number of bytes.
        """

    def summary(self, /) -> str:
        """
        What the command prints: the answers, and behind them the tables.
        """

    def tables(self, /) -> list[tuple[list[str], list[list[str]]]]:
        """
        The tables that the command prints: heads and rows of each.
        """

    def took_s(self, /) -> float:
        """
        How long the work took in Rust, in s.
        """

    def write(self, /, folder: str | PathLike[str], trajectories: bool, force: bool) -> Path:
        """
        Writes all of it into a folder, as `kalmems estimate` does; where that is.
        """

@final
class Stream:
    """
    A stream that is being estimated on a thread of its own.
    """

    def __new__(cls, /, text: str, path: str | PathLike[str], state: str | PathLike[str] | None=None) -> Stream:
        """
        Begins to estimate samples as the table `stream` of an experiment says.
        """

    def close(self, /) -> None:
        """
        Says that no more samples come.
        """

    def feed(self, /, samples: SupportsGetItem[int, SupportsIndex]) -> bool:
        """
        Hands samples over as they come, in whatever pieces; waits where too many wait already. `False` where nobody takes them any more.
        """

    def lines(self, /, wait: bool) -> bytes | None:
        """
        The next lines; `None` where `wait` says not to wait and none are there. Nothing at the end of the stream.
        """

    def stop(self, /) -> None:
        """
        Stops the work where it is.
        """

    def summary(self, /) -> str | None:
        """
        What came of the stream, once it has ended, as JSON.
        """

def batch_files(patterns: SupportsGetItem[int, str]) -> list[tuple[str, Path]]:
    """
    The files that paths and patterns name, each by the name that it has in a batch.
    """

def calibrate(path: str | PathLike[str], progress: _Progress=None) -> tuple[str, str, dict[str, bytes]]:
    """
    Calibrates a gyroscope: the figures as JSON, as text, and the pictures.
    """

def check(text: str, path: str | PathLike[str], has_lines: bool) -> tuple[str, str | None, str]:
    """
    Refuses the text of an experiment that is wrong; without lines, where no file has them. Its name and its description.
    """

def diagnose(text: str, path: str | PathLike[str], has_lines: bool, recordings: SupportsGetItem[int, tuple[str | None, Columns]], filter: str | None=None, thorough: bool=False, progress: _Progress=None) -> tuple[str, str, str | None, list[str | None]]:
    """
    Finds what of an experiment is wrong: what was found as JSON, as text, the experiment with the cause corrected where there is one to choose, and with
    each of the causes that it can state.
    """

def estimate(text: str, path: str | PathLike[str], has_lines: bool, recordings: SupportsGetItem[int, tuple[str | None, Columns]], references: SupportsGetItem[int, tuple[str | None, Columns]], progress: _Progress=None) -> Outcome:
    """
    Estimates an experiment.
    """

def estimate_many(text: str, path: str | PathLike[str], has_lines: bool, recordings: SupportsGetItem[int, tuple[str, str | PathLike[str] | None, Columns | None]], folder: str | PathLike[str], of: str | None=None, reference: str | None=None, threads: SupportsIndex | None=None, force: bool=False, progress: _Progress=None) -> tuple[str, str, int, int, bool]:
    """
    Estimates recordings and writes the results into a folder: the summary as JSON and as text, how many were estimated now and how many
    before, and whether a reference was left out.
    """

def identify(text: str, path: str | PathLike[str], has_lines: bool, recordings: SupportsGetItem[int, tuple[str | None, Columns]], references: SupportsGetItem[int, tuple[str | None, Columns]], progress: _Progress=None) -> tuple[str, str, str]:
    """
    Identifies parameters: what was found as JSON, as text, and the experiment with it.
    """

def image(path: str | PathLike[str], progress: _Progress=None) -> tuple[str, str, _Numbers]:
    """
    Puts an image together: the figures as JSON, as text, and the image.
    """

def innovation_tests(signals: Sequence[tuple[str, Sequence[float], Sequence[float], Sequence[float]]], motions_hz: Sequence[float], whitens: bool, sum_nis: float, updates: int) -> tuple[str, list[tuple[str, float, float, str]], tuple[float, float, float, int]]:
    """
    Tests the innovations of several signals, whose NIS have this sum over so many numbers: the grade, what is found, and the mean NIS.
    """

def kalman(z: _Numbers, f: _Numbers, h: _Numbers, q: _Numbers, r: _Numbers, x0: _Numbers, p0: _Numbers, b: _Numbers | None, u: _Numbers | None, manner: tuple[str, tuple[float, float, float], tuple[float, float], int]) -> dict[str, _Numbers]:
    """
    The linear Kalman filter over arrays.
    """

def nonlinear(z: _Numbers, functions: Sequence[_Function], q: _Numbers, r: _Numbers, x0: _Numbers, p0: _Numbers, u: _Numbers | None, manner: tuple[str, tuple[float, float, float], tuple[float, float], int]) -> dict[str, _Numbers]:
    """
    The filter of a model of functions.
    """

def replaced(text: str, path: str | PathLike[str], changes: dict[str, Any]) -> str:
    """
    The text of an experiment with other values at some keys, such as `recording[0].clock.rate`; without those that become `None`.
    """

def run_command(arguments: SupportsGetItem[int, str], owns_process: bool=False) -> int:
    """
    Does what these arguments say, of which the first is the name of the program; its exit code.

    With `owns_process` the process is the command's alone, which then handles interruptions itself. Without it the handlers of Python stay, and what
    they raise is raised once the command has ended.
    """

def simulate(text: str, path: str | PathLike[str], has_lines: bool, progress: _Progress=None) -> tuple[dict[str, _Numbers], dict[str, _Numbers], str]:
    """
    Simulates the recording that an experiment describes.
    """

def spectrum(path: str | PathLike[str], progress: _Progress=None) -> tuple[str, str, _Numbers, _Numbers, _Numbers | None]:
    """
    Computes a spectrum: the figures as JSON, as text, the wavenumbers in 1/m, the spectrum and its standard error.
    """

def study_check(texts: tuple[str, str, str | PathLike[str]]) -> tuple[str, int, int]:
    """
    Refuses a study that is wrong; its name, its points and its runs.
    """

def study_merge(texts: tuple[str, str, str | PathLike[str]], journals: SupportsGetItem[int, str | PathLike[str]], folder: str | PathLike[str], force: bool) -> tuple[str, str, str, Path]:
    """
    Joins journals and writes the results into a folder: the summary as JSON, as text, the pictures of the report as data, and the folder.
    """

def study_run(texts: tuple[str, str, str | PathLike[str]], folder: str | PathLike[str], part: SupportsIndex, of: SupportsIndex, threads: SupportsIndex | None=None, progress: _Progress=None) -> Path:
    """
    Runs a part of a study that its journal does not have yet; the journal, which stands beside the folder of the results.
    """

def to_dict(text: str, path: str | PathLike[str]) -> dict[str, Any]:
    """
    The text of an experiment as a dictionary.
    """

def to_toml(document: dict[str, Any]) -> str:
    """
    The text of an experiment of a dictionary.
    """
