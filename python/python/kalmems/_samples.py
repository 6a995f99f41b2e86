"""Arrays as the text that a stream reads, a line for each sample and every number to its last digit."""

from __future__ import annotations

from collections.abc import AsyncIterable, Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, TypeAlias, TypeGuard

import numpy as np
from numpy.typing import NDArray

from ._errors import RecordingError
from ._recording import Recording, as_recording
from ._tables import is_path, is_table

if TYPE_CHECKING:
    from ._experiment import Experiment

Samples: TypeAlias = "NDArray[Any] | Recording | Mapping[str, Any]"
"""An array, a recording or any table."""

ROWS = 4096
"""So many samples are handed over at once."""


def columns(experiment: Experiment) -> tuple[list[str], bool]:
    """The names of a sample's numbers in the order of the stream, and whether they come as text."""
    given = experiment.to_dict().get("stream", {}).get("input", {})
    if "frames" in given:
        # A field is its type and its name; the one that counts the frames is no number of a sample.
        names = [field.split()[-1] for field in given["frames"].get("fields", [])]
        return [name for name in names if name != "sequence"], False
    return list(given.get("text", {}).get("columns", [])), True


def is_whole(source: Any) -> TypeGuard[Samples]:
    """Whether a source is itself the samples, and not something that gives them piece by piece."""
    return isinstance(source, (Recording, np.ndarray)) or is_table(source)


def check(source: Any) -> None:
    """Refuses a source whose elements would be letters or bytes."""
    if is_path(source):
        raise RecordingError(f"the source of a stream is not a path; open it: `experiment.stream(open({str(source)!r}, 'rb'))`")
    if isinstance(source, (bytes, bytearray, memoryview)):
        raise RecordingError("the source of a stream gives pieces of bytes; give a list of them: `experiment.stream([content])`")
    if not isinstance(source, (Iterable, AsyncIterable)) and not is_whole(source):
        kind = type(source).__name__
        raise RecordingError(f"the source of a stream is of the type {kind}; expected something that gives pieces of bytes, text or arrays")


def encoded(pieces: Iterable[Any], names: Sequence[str]) -> Iterator[bytes]:
    """The bytes of pieces of bytes, text or samples."""
    for piece in pieces:
        yield from encoded_piece(piece, names)


def encoded_piece(piece: Any, names: Sequence[str]) -> Iterator[bytes]:
    """The bytes of a piece: of bytes or text as they are, of samples as lines."""
    is_octets = isinstance(piece, np.ndarray) and piece.dtype == np.uint8
    if isinstance(piece, str):
        yield piece.encode()
    elif isinstance(piece, (bytes, bytearray, memoryview)) or is_octets:
        yield bytes(piece)
    elif is_whole(piece):
        yield from lines(piece, names)
    else:
        kind = type(piece).__name__
        raise RecordingError(f"the source of the stream gave {kind}; expected bytes, text, an array with a row for each sample, or a table")


def lines(samples: Any, names: Sequence[str]) -> Iterator[bytes]:
    """Samples as lines, in pieces."""
    if not names:
        raise RecordingError("the experiment does not say the columns of its stream; state `stream.input.text.columns`")
    cells = _of_array(samples, names) if isinstance(samples, np.ndarray) and not samples.dtype.names else _of_table(samples, names)
    for start in range(0, len(cells[0]), ROWS):
        texts = (map(_text, column[start : start + ROWS].tolist()) for column in cells)
        yield "".join(f"{','.join(row)}\n" for row in zip(*texts, strict=True)).encode()


def _text(number: float | None) -> str:
    """A number as Python reads it back to the last bit; nothing if it is missing."""
    return "" if number is None or number != number else repr(number)


def _of_array(array: Any, names: Sequence[str]) -> list[Any]:
    rows = np.atleast_2d(array)
    if rows.ndim != 2 or rows.shape[1] != len(names):
        raise RecordingError(f"an array of the shape {array.shape}; expected {len(names)} columns, {', '.join(names)}, with a row for each sample")
    return [_number(name, rows[:, place]) for place, name in enumerate(names)]


def _of_table(table: Any, names: Sequence[str]) -> list[Any]:
    recording = as_recording(table)
    stated = [what for what, one in (("units", recording._units), ("segments", recording._segments), ("clock", recording._clock)) if one]
    if stated:
        mend = "give numbers in the units that the names of the columns have, and state the rest in the experiment"
        raise RecordingError(f"a stream does not read the {', '.join(stated)} of a recording; {mend}")
    for name in names:
        if name in recording.unread:
            raise RecordingError(f"column `{name}` cannot be read: {recording.unread[name]}")
        if name not in recording:
            known = ", ".join(f"`{one}`" for one in recording)
            raise RecordingError(f"column `{name}`: there is no such column (there are {known}); the stream consists of {', '.join(names)}")
    return [_number(name, recording[name]) for name in names]


def _number(name: str, values: Any) -> Any:
    if values.dtype.kind not in "fiub":
        raise RecordingError(f"column `{name}` holds {values.dtype}; a stream takes numbers, and times as numbers of seconds")
    return values
