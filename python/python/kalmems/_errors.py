"""What can go wrong, with what it is about as data. All of it can be pickled, so that it comes back from another process whole."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ._result import Result


@dataclass(frozen=True)
class Finding:
    """What the diagnosis of a recording found: one kind, where it is first seen and how often."""

    kind: str
    """What kind it is, such as `missing` or `decreasing_time`."""
    severity: str
    """`fatal` where the recording cannot be used, `note` where it can."""
    message: str
    """The finding as a sentence, with what follows from it."""
    column: str | None = None
    """The column, where it concerns one."""
    segment: str | None = None
    """The segment, where it concerns one of several."""
    first: int = 0
    """Where it is first seen: the sample, counted from 0, of arrays, and the line, counted from 1, of files."""
    count: int = 1
    """How often it is seen."""

    def __str__(self) -> str:
        return self.message


class KalmemsError(ValueError):
    """Anything that this package refuses."""

    def __reduce__(self) -> tuple[Any, ...]:
        return (type(self), self.args)

    def __str__(self) -> str:
        return str(self.args[0]) if self.args else ""


class ExperimentError(KalmemsError):
    """An experiment is wrong: where, and what to write instead."""

    def __init__(
        self, message: str, file: str = "", key: str = "", line: int | None = None, column: int | None = None
    ) -> None:
        super().__init__(message, file, key, line, column)
        self.file = file
        """The file, as it was named."""
        self.key = key
        """The key, such as `recording[0].clock.rate`; empty where the whole file is meant."""
        self.line = line
        """The line, counted from 1; `None` where there is no text that would have lines."""
        self.column = column
        """The column in characters, likewise."""


class RecordingError(KalmemsError):
    """A recording cannot be used."""

    def __init__(self, message: str, file: str = "", findings: Sequence[Finding] = ()) -> None:
        super().__init__(message, file, tuple(findings))
        self.file = file
        """The file, or the name in whose place arrays stand."""
        self.findings: tuple[Finding, ...] = tuple(findings)
        """All that was found, what makes it unusable first."""


class EstimationError(KalmemsError):
    """What was asked for could not be computed from experiment and recordings that are right in themselves."""


class VerdictError(KalmemsError):
    """An answer cannot be trusted, and `strict=True` asked to be told so."""

    def __init__(self, message: str, result: Result | None = None) -> None:
        super().__init__(message, result)
        self.result = result
        """The result with that answer."""


class VerdictWarning(UserWarning):
    """An answer cannot be trusted."""
