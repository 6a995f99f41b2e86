"""Recordings as arrays."""

from __future__ import annotations

import contextlib
import html
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _kalmems
from ._errors import KalmemsError, RecordingError
from ._tables import TIME_POWERS, Unreadable, named, plain, unit
from ._units import is_quantity, spelled


class Recording:
    """Sampled channels as arrays, instead of a file that an experiment names.

    The numbers are copied once, so that nobody can change them afterwards. They are read as those of a file would be: their units are what
    the names of the columns end with (`cap_V`, `time_us`), what is wrong is found and counted, and nothing is repaired.

    `columns` is a mapping of names to arrays or lists, or a table: a DataFrame of pandas or polars, a LazyFrame, which is computed, a Dataset
    of xarray, a table of Arrow, or a structured array of NumPy. An index of pandas is a column if it has a name; one of times without a name
    is the column `time_s`. Elements that are masked or null are missing; so is what is not a number. Times may be numbers or `datetime64`,
    and times of a zone are converted to UTC.

    A column that cannot be read, such as one of objects or complex numbers, is left out and named in `unread`. It is an error only if an
    experiment asks for it.

    `units` says what the numbers of a column are in if its name does not, or says it wrongly: `units={"cap_V": "mV"}`. An array of pint
    and the attribute `units` of a variable of xarray say so themselves; `units` comes before them.

    `segments` names a column that tells several records apart, or is an array of their labels. `clock` names the column of the times, or is
    the sampling rate in Hz. If they are left out, the experiment says it.
    """

    def __init__(
        self,
        columns: object,
        *,
        units: Mapping[str, str] | None = None,
        segments: str | ArrayLike | None = None,
        clock: str | float | None = None,
        name: str | None = None,
    ) -> None:
        if units is not None and not isinstance(units, Mapping):
            raise RecordingError('`units` is a mapping of columns to units, such as {"cap_V": "mV"}')
        if clock is not None and not isinstance(clock, (str, int, float, np.number)):
            raise RecordingError("`clock` is the name of the column of the times, or the sampling rate in Hz as a number")
        self.name = name
        self._units = dict(units or {})
        self._columns: dict[str, tuple[Any, NDArray[np.bool_] | None]] = {}
        self.unread: dict[str, str] = {}
        """The columns that are left out, and why."""
        for column, values in named(columns):
            self._add(column, values)
        if not self._columns:
            reasons = "; ".join(f"`{column}`: {why}" for column, why in self.unread.items())
            raise RecordingError(f"there is no column that can be read. {reasons}".rstrip(" ."))
        if segments is not None and not isinstance(segments, str):
            self._add("segment", segments)
            segments = "segment"
        self._segments: str | None = segments
        self._clock = clock
        self._native = self._handed_over()

    def _add(self, name: str, values: Any) -> None:
        own = unit(values)
        if is_quantity(values):
            own, values = spelled(values.units) or "1", values.magnitude
        try:
            array, missing = plain(values)
        except Unreadable as why:
            self.unread[name] = str(why)
            return
        if own is not None:
            self._units.setdefault(name, own)
        # The recording's own, so that neither it nor its digest changes with the arrays that it was made of.
        self._columns[name] = _frozen(array), None if missing is None else _frozen(missing)

    def _handed_over(self) -> _kalmems.Columns:
        columns = []
        for name, (values, missing) in self._columns.items():
            kind, size, power = values.dtype.kind, values.dtype.itemsize, 0
            if kind in "mM":
                power = TIME_POWERS[np.datetime_data(values.dtype)[0]]
            if kind == "b":
                kind = "u"
            columns.append((name, kind, size, power, values.view(np.uint8), missing))
        clock = self._clock if isinstance(self._clock, str) else None
        rate = None if self._clock is None or isinstance(self._clock, str) else float(self._clock)
        return _kalmems.Columns(columns, self._units, self._segments, clock, rate)

    @property
    def columns(self) -> tuple[str, ...]:
        """The names of the columns."""
        return tuple(self._columns)

    @property
    def sha256(self) -> str:
        """A digest of names, types and numbers: other arrays are another input of a result."""
        return self._native.sha256

    def __len__(self) -> int:
        return len(self._native)

    def __contains__(self, column: object) -> bool:
        return column in self._columns

    def __iter__(self) -> Iterator[str]:
        """The names of the columns."""
        return iter(self._columns)

    def __getitem__(self, column: str) -> NDArray[Any]:
        """A column as it was taken over; masked where elements are missing."""
        if column not in self._columns:
            known = ", ".join(self._columns)
            raise KeyError(f"`{column}` is not read: {self.unread[column]}" if column in self.unread else f"no column `{column}`; there are {known}")
        values, missing = self._columns[column]
        return values if missing is None else np.ma.MaskedArray(values, missing.copy())

    def _repr_html_(self) -> str:
        return f"<p>{html.escape(repr(self)[1:-1])}</p>"

    def __repr__(self) -> str:
        name = f" {self.name!r}" if self.name else ""
        unread = f"; not read: {', '.join(self.unread)}" if self.unread else ""
        return f"<Recording{name}: {len(self)} samples of {', '.join(self.columns)}{unread}>"

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in self.__dict__.items() if name != "_native"}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        # Pickling leaves out that an array is not to be written to.
        for values, missing in self._columns.values():
            values.flags.writeable = False
            if missing is not None:
                missing.flags.writeable = False
        self._native = self._handed_over()


def _frozen(values: Any) -> Any:
    """A copy that nobody can change."""
    own = np.array(values)
    own.flags.writeable = False
    return own


def as_recording(values: object) -> Recording:
    """A recording, or whatever has the columns of one."""
    return values if isinstance(values, Recording) else Recording(values)


@contextlib.contextmanager
def explained(recordings: Sequence[Recording]) -> Iterator[None]:
    """An error about a column that is left out says why it is."""
    try:
        yield
    except KalmemsError as error:
        for recording in recordings:
            for column, why in recording.unread.items():
                # The one text is that of a column which is wanted, the other of one that `units`, `clock` or `segments` names.
                if f"column `{column}`" in str(error) or f"unknown word `{column}`" in str(error):
                    file, findings = getattr(error, "file", ""), getattr(error, "findings", ())
                    raise RecordingError(f"column `{column}` cannot be read: {why}", file, findings) from error
        raise
