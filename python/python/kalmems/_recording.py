"""Recordings as arrays."""

from __future__ import annotations

import html
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import _kalmems
from ._needed import needed
from ._units import is_quantity, spelled

_POWERS = {"s": 0, "ms": -3, "us": -6, "ns": -9, "ps": -12, "fs": -15, "as": -18}


class Recording:
    """Sampled channels as arrays, in the place of a file that an experiment names.

    The numbers are copied once, so that nobody can change them afterwards. They are read as those of a file would be: their units are what
    the names of the columns end with (`cap_V`, `time_us`), what is wrong is found and counted, and nothing is repaired.

    `columns` is a mapping of names to arrays, or a table of pandas, polars, xarray, Arrow or a structured array of NumPy. Elements that are
    masked or null are missing; so is what is not a number. Times may be numbers or `datetime64`.

    `units` says what the numbers of a column are in where its name does not, or says it wrongly: `units={"cap_V": "mV"}`. An array of pint
    says so itself.

    `segments` names a column that tells several records apart, or is an array of their labels. `clock` names the column of the times, or is
    the sampling rate in Hz. Where they are left out, the experiment says it.
    """

    def __init__(
        self,
        columns: Any,
        *,
        units: Mapping[str, str] | None = None,
        segments: str | Any | None = None,
        clock: str | float | None = None,
        name: str | None = None,
    ) -> None:
        self.name = name
        self._units = dict(units or {})
        self._columns: dict[str, tuple[Any, NDArray[np.bool_] | None]] = {}
        for column, values in _named(columns):
            self._add(column, values)
        if segments is not None and not isinstance(segments, str):
            self._add("segment", segments)
            segments = "segment"
        self._segments: str | None = segments
        self._clock = clock
        self._native = self._handed_over()

    def _add(self, name: str, values: Any) -> None:
        if is_quantity(values):
            self._units.setdefault(name, spelled(values.units) or "1")
            values = values.magnitude
        plain, missing = _plain(name, values)
        # The recording's own, so that neither it nor its digest changes behind its back.
        self._columns[name] = _frozen(plain), None if missing is None else _frozen(missing)

    def _handed_over(self) -> _kalmems.Columns:
        columns = []
        for name, (values, missing) in self._columns.items():
            kind, size, power = values.dtype.kind, values.dtype.itemsize, 0
            if kind in "mM":
                power = _time_power(name, values.dtype)
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

    def __getitem__(self, column: str) -> Any:
        """A column as it was taken over; masked where elements are missing."""
        values, missing = self._columns[column]
        return values if missing is None else np.ma.MaskedArray(values, missing.copy())

    def _repr_html_(self) -> str:
        return f"<p>{html.escape(repr(self)[1:-1])}</p>"

    def __repr__(self) -> str:
        name = f" {self.name!r}" if self.name else ""
        return f"<Recording{name}: {len(self)} samples of {', '.join(self.columns)}>"

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


def _named(columns: Any) -> Iterator[tuple[str, Any]]:
    """The columns of whatever has columns."""
    if isinstance(columns, Mapping) and not hasattr(columns, "data_vars"):
        for name, values in columns.items():
            yield str(name), values
    elif isinstance(columns, np.ndarray) and columns.dtype.names:
        for name in columns.dtype.names:
            yield name, columns[name]
    else:
        yield from _named_by_table(columns)


def _named_by_table(table: Any) -> Iterator[tuple[str, Any]]:
    """The columns of a table of another library."""
    if hasattr(table, "data_vars"):
        # An xarray.Dataset, with its coordinates.
        for name in (*table.coords, *table.data_vars):
            yield str(name), table[name].values
    elif hasattr(table, "column_names"):
        # A pyarrow.Table.
        for name in table.column_names:
            yield name, table[name]
    elif hasattr(table, "columns"):
        # pandas or polars.
        for name in table.columns:
            yield str(name), table[name]
    elif hasattr(table, "__arrow_c_stream__"):
        yield from _named(needed("pyarrow", "arrow").table(table))
    else:
        raise TypeError(
            f"columns of the type {type(table).__name__}; expected a mapping of names to arrays, such as "
            '{"time_s": t, "cap_V": y}, or a table of pandas, polars, xarray or Arrow'
        )


def _plain(name: str, values: Any) -> tuple[Any, NDArray[np.bool_] | None]:
    """An array of one axis, one after the other in memory, and which elements are missing."""
    missing: Any = None
    if isinstance(values, np.ma.MaskedArray):
        missing = np.ma.getmaskarray(values)
        values = values.data
    elif hasattr(values, "is_null") and hasattr(values, "null_count"):
        # polars and Arrow.
        nulls = values.is_null()
        count: Any = values.null_count
        count = count() if callable(count) else count
        if int(count) > 0:
            missing = np.asarray(nulls)
            values = values.fill_null(0)
    elif hasattr(values, "isna") and hasattr(values.dtype, "na_value"):
        # An extension type of pandas.
        missing = np.asarray(values.isna(), dtype=bool)
        if missing.any() and values.dtype.kind in "iufb":
            values = values.fillna(0)
        values = values.to_numpy()
    array = np.asarray(values)
    if array.ndim != 1:
        raise ValueError(f"`{name}` has {array.ndim} axes; expected one, with an element for each sample")
    if array.dtype.kind == "O":
        array = _of_objects(name, array)
    if array.dtype.kind == "U":
        array = np.char.encode(array, "utf-8") if array.size else array.astype("S1")
    if array.dtype.kind in "mM":
        gone = np.isnat(array)
        if gone.any():
            missing = gone if missing is None else missing | gone
    if array.dtype.kind not in "fiubmMS" or array.dtype.itemsize > 8 and array.dtype.kind != "S":
        raise TypeError(
            f"`{name}` holds elements of the type {array.dtype}; expected real numbers of at most 64 bits, times or labels"
        )
    array = np.ascontiguousarray(array)
    if array.dtype.byteorder == ">" or (array.dtype.byteorder == "=" and not np.little_endian):
        array = array.astype(array.dtype.newbyteorder("<"))
    if missing is not None:
        missing = np.ascontiguousarray(missing, dtype=bool)
        if missing.shape != array.shape:
            raise ValueError(f"`{name}` has {array.size} elements and a mask of {missing.size}")
    return array, missing


def _of_objects(name: str, array: NDArray[Any]) -> NDArray[Any]:
    """Labels, or numbers among which some are `None`."""
    if all(isinstance(value, str) for value in array):
        return array.astype(str)
    try:
        return array.astype(np.float64)
    except (TypeError, ValueError) as error:
        raise TypeError(f"`{name}` holds Python objects; expected numbers or texts: {error}") from None


def _time_power(name: str, dtype: np.dtype[Any]) -> int:
    unit, count = np.datetime_data(dtype)
    if unit not in _POWERS or count != 1:
        raise TypeError(f"`{name}` counts {count} {unit}; expected one of {', '.join(_POWERS)}: use .astype('datetime64[ns]')")
    return _POWERS[unit]
