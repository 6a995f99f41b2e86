"""What an estimated motion is for: images, spectra, and the calibration of inertial sensors, each as its file describes it."""

from __future__ import annotations

import html
import json
import os
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias, cast

import numpy as np
from numpy.typing import NDArray

from . import _kalmems
from ._needed import needed

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["Calibration", "Image", "Spectrum", "calibrate", "image", "spectrum"]

Numbers = NDArray[np.float64]
Progress: TypeAlias = "Callable[[str, int, int], object] | None"


@dataclass(frozen=True, eq=False, repr=False)
class _Told:
    metrics: dict[str, Any] = field(repr=False)
    """The figures, as the command writes them."""
    text: str = field(repr=False)
    """The figures as text."""

    @property
    def answer(self) -> list[str]:
        """The result in sentences, as the command prints them first."""
        return list(self.metrics["answer"])

    def __repr__(self) -> str:
        return self.text

    def _repr_html_(self) -> str:
        return f"<pre>{html.escape(self.text)}</pre>"


@dataclass(frozen=True, eq=False, repr=False)
class Calibration(_Told):
    """The calibration of gyroscopes and accelerometers, with its budgets of uncertainty."""

    figures: dict[str, bytes]
    """The pictures of the report by their names, as SVG."""


@dataclass(frozen=True, eq=False, repr=False)
class Image(_Told):
    """An image that was put together along a trajectory."""

    values: Numbers
    """Intensities, row after row from the top."""

    def plot(self, *, ax: Axes | None = None) -> Axes:
        """Draws it (needs matplotlib); the axes."""
        plt = needed("matplotlib.pyplot", "plot")

        if ax is None:
            ax = cast("Axes", plt.subplots(layout="constrained")[1])
        ax.imshow(self.values, cmap="gray", interpolation="nearest")
        ax.set_xlabel("column")
        ax.set_ylabel("row")
        return ax


@dataclass(frozen=True, eq=False, repr=False)
class Spectrum(_Told):
    """A spectrum along estimated positions."""

    wavenumber: Numbers
    """In 1/m."""
    values: Numbers
    sd: Numbers | None
    """The standard error by the differences of the scans, where there are several."""

    def plot(self, *, ax: Axes | None = None) -> Axes:
        """Draws it, with its standard error where that is known (needs matplotlib); the axes."""
        plt = needed("matplotlib.pyplot", "plot")

        if ax is None:
            ax = cast("Axes", plt.subplots(figsize=(8, 3.2), layout="constrained")[1])
        ax.plot(self.wavenumber, self.values, linewidth=1)
        if self.sd is not None:
            ax.fill_between(self.wavenumber, self.values - self.sd, self.values + self.sd, alpha=0.25, linewidth=0)
        ax.set_xlabel("wavenumber (1/m)")
        ax.set_ylabel("spectrum")
        return ax


def calibrate(path: str | os.PathLike[str], *, progress: Progress = None) -> Calibration:
    """Calibrates gyroscopes and accelerometers, as `kalmems calibrate gyro` does."""
    found, text, figures = _kalmems.calibrate(Path(path), progress)
    return Calibration(json.loads(found), text, figures)


def image(path: str | os.PathLike[str], *, progress: Progress = None) -> Image:
    """Puts an image together, as `kalmems image` does."""
    found, text, values = _kalmems.image(Path(path), progress)
    return Image(json.loads(found), text, values)


def spectrum(path: str | os.PathLike[str], *, progress: Progress = None) -> Spectrum:
    """Computes a spectrum, as `kalmems spectrum` does."""
    found, text, wavenumber, values, sd = _kalmems.spectrum(Path(path), progress)
    return Spectrum(json.loads(found), text, wavenumber, values, sd)
