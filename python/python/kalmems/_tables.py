"""The columns of tables of any library as arrays of NumPy. What cannot be read says why, and what to give instead."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterator, Mapping
from typing import Any, TypeGuard

import numpy as np
from numpy.typing import NDArray

from ._errors import RecordingError
from ._needed import needed
from ._places import is_remote

TIME_POWERS = {"s": 0, "ms": -3, "us": -6, "ns": -9, "ps": -12, "fs": -15, "as": -18}
"""The powers of ten of the units in which NumPy counts times, in s."""
TIMES = "time_s"
"""The name of an index of times that has no name of its own."""
_ATTRIBUTES = ("iloc", "get_columns", "collect_schema", "data_vars", "column_names", "colnames")
"""What the tables of pandas, polars, xarray, Arrow and Astropy have, and their columns do not."""


class Unreadable(Exception):
    """Why a column cannot be read, and what to give instead."""


def is_path(value: object) -> TypeGuard[str | os.PathLike[str]]:
    """Whether a value names a file."""
    return isinstance(value, (str, os.PathLike))


def is_table(value: Any) -> bool:
    """Whether a value has columns of its own."""
    is_series = hasattr(value, "iloc") and not hasattr(value, "columns")
    return not is_series and (isinstance(value, Mapping) or _has_fields(value) or any(hasattr(value, one) for one in _ATTRIBUTES))


def _has_fields(value: Any) -> bool:
    """Whether a value is a structured array of NumPy."""
    return isinstance(value, np.ndarray) and value.dtype.names is not None


def named(table: Any) -> Iterator[tuple[str, Any]]:
    """The columns of whatever has columns. One whose name is not its own is given as the `Unreadable` that says so."""
    try:
        found = [(str(name), values) for name, values in _named(table)]
    except (RecordingError, ImportError, MemoryError):
        raise
    except Exception as error:
        # A library may raise anything, such as when a query of polars is computed here.
        kind = type(table).__name__
        raise RecordingError(f"the columns of this {kind} cannot be read: {error}; give a mapping of names to arrays") from error
    counts = Counter(name for name, _ in found)
    for name in counts:
        values = next(values for one, values in found if one == name)
        yield name, values if counts[name] == 1 else Unreadable(f"{counts[name]} columns have this name; rename all but one")


def _named(table: Any) -> Iterator[tuple[Any, Any]]:
    if hasattr(table, "data_vars"):
        # An xarray.Dataset, with its coordinates.
        for name in (*table.coords, *table.data_vars):
            yield name, table[name]
    elif isinstance(table, Mapping):
        yield from table.items()
    elif _has_fields(table):
        for name in table.dtype.names:
            yield name, table[name]
    elif hasattr(table, "iloc") and hasattr(table, "columns"):
        yield from _of_pandas(table)
    elif hasattr(table, "get_columns"):
        # A polars.DataFrame.
        yield from zip(table.columns, table.get_columns(), strict=True)
    elif hasattr(table, "collect_schema"):
        # A polars.LazyFrame.
        yield from _named(table.collect())
    elif hasattr(table, "column_names"):
        # A pyarrow.Table.
        for place, name in enumerate(table.column_names):
            yield name, table.column(place)
    elif hasattr(table, "dims") and hasattr(table, "to_dataset"):
        # An xarray.DataArray, which needs a name to be a column.
        yield from _named(table.to_dataset())
    elif hasattr(table, "__arrow_c_stream__"):
        yield from _named(needed("pyarrow", "arrow").table(table))
    elif hasattr(table, "colnames"):
        # An astropy.table.Table.
        for name in table.colnames:
            yield name, table[name]
    elif hasattr(table, "columns") and not callable(table.columns):
        # Whatever else lists its columns and gives each under its name.
        for name in table.columns:
            yield name, table[name]
    else:
        raise RecordingError(_no_table(table))


def _of_pandas(table: Any) -> Iterator[tuple[Any, Any]]:
    """The columns, and those of the index that have a name or hold times. An index that counts the rows says nothing of the samples."""
    names = [str(name) for name in table.columns]
    for place in range(table.index.nlevels):
        values = table.index.get_level_values(place)
        name = values.name
        if name is None and getattr(values.dtype, "kind", "") in "mM":
            name = TIMES
        if name is not None and str(name) not in names:
            yield name, values
    for place, name in enumerate(names):
        yield name, table.iloc[:, place]


def _no_table(value: Any) -> str:
    if is_path(value):
        return f"{str(value)!r} is a path; give it to the work itself, such as `experiment.estimate({str(value)!r})`, or read the file first"
    if isinstance(value, np.ndarray):
        mend = 'name its columns, such as {"time_s": array[:, 0], "cap_V": array[:, 1]}'
        return f"an array of {value.ndim} axes has no names of columns; {mend}"
    if isinstance(value, (list, tuple)):
        mend = 'such as {"time_s": t, "cap_V": y}; several recordings are a mapping of their names or roles'
        return f"columns of the type {type(value).__name__} have no names; expected a mapping of names to arrays, {mend}"
    expected = 'a mapping of names to arrays, such as {"time_s": t, "cap_V": y}, or a table of pandas, polars, xarray or Arrow'
    return f"columns of the type {type(value).__name__}; expected {expected}"


def local(path: Any) -> str:
    """The absolute path of a file of this machine."""
    if is_remote(path):
        mend = "copy it here first, or use `estimate_many`, which fetches paths with a scheme"
        raise RecordingError(f"{path!r} is not a file of this machine; {mend}", str(path))
    return str(os.path.abspath(path))


def unit(values: Any) -> str | None:
    """The unit that the attributes of a variable of xarray state."""
    stated = values.attrs.get("units") if hasattr(values, "dims") and hasattr(values, "attrs") else None
    # Times have their unit in their type.
    return stated if isinstance(stated, str) and stated and values.dtype.kind not in "mM" else None


def plain(values: Any) -> tuple[Any, NDArray[np.bool_] | None]:
    """An array of one axis, one after the other in memory, and which elements are missing."""
    if isinstance(values, Unreadable):
        raise values
    try:
        return _checked(*_split(values))
    except (Unreadable, MemoryError):
        raise
    except Exception as error:
        # Each library of arrays raises errors of its own.
        raise Unreadable(f"{type(values).__name__} cannot be converted: {error}; give an array of numbers") from error


def _split(values: Any) -> tuple[NDArray[Any], Any]:
    """The elements as an array, and which are missing; `None` if none are or the elements say it."""
    dtype: Any = getattr(values, "dtype", None)
    if isinstance(values, np.ma.MaskedArray):
        return np.asarray(values.data), np.ma.getmaskarray(values)
    if hasattr(values, "is_null") and hasattr(values, "null_count"):
        return _without_nulls(values)
    if getattr(dtype, "tz", None) is not None:
        # pandas, as times of UTC.
        return values.to_numpy(dtype=f"datetime64[{dtype.unit}]"), None
    if hasattr(values, "isna") and hasattr(dtype, "na_value"):
        # An extension type of pandas.
        missing = np.asarray(values.isna(), dtype=bool)
        if missing.any() and dtype.kind in "iufb":
            values = values.fillna(0)
        return np.asarray(values.to_numpy()), missing
    return np.asarray(values), None


def _without_nulls(values: Any) -> tuple[NDArray[Any], Any]:
    """A column of polars or Arrow: where it is null, and other elements in place of the nulls."""
    count: Any = values.null_count
    count = count() if callable(count) else count
    if int(count) == 0:
        return np.asarray(values), None
    missing = np.asarray(values.is_null())
    elements = np.asarray(values)
    # NumPy has the missing times as such, and missing numbers as floating-point ones, which would lose digits of large integers.
    return elements if elements.dtype.kind in "mMOU" else np.asarray(values.fill_null(0)), missing


def _checked(array: NDArray[Any], missing: Any) -> tuple[Any, NDArray[np.bool_] | None]:
    if array.ndim != 1:
        raise Unreadable(f"it has {array.ndim} axes; give a column for each series, with an element for each sample")
    if array.dtype.kind == "O":
        array = _of_objects(array, missing)
    if array.dtype.kind == "U":
        array = np.char.encode(array, "utf-8") if array.size else array.astype("S1")
    if array.dtype.kind in "mM":
        _check_times(array.dtype)
        gone = np.isnat(array)
        if gone.any():
            missing = gone if missing is None else missing | gone
    if array.dtype.kind not in "fiubmMS" or array.dtype.itemsize > 8 and array.dtype.kind != "S":
        raise Unreadable(f"its elements are of the type {array.dtype}; give real numbers of at most 64 bits, times or labels")
    array = np.ascontiguousarray(array)
    if array.dtype.byteorder == ">" or (array.dtype.byteorder == "=" and not np.little_endian):
        array = array.astype(array.dtype.newbyteorder("<"))
    if missing is not None:
        missing = np.ascontiguousarray(missing, dtype=bool)
        if missing.shape != array.shape:
            raise Unreadable(f"it has {array.size} elements and a mask of {missing.size}; give a mask for each element")
    return array, missing


def _of_objects(array: NDArray[Any], missing: Any) -> NDArray[Any]:
    """Labels, or numbers among which some are `None`."""
    gone = np.zeros(array.shape, bool) if missing is None else missing
    if all(isinstance(value, str) for value in array[~gone]):
        return np.where(gone, "", array).astype(str)
    try:
        return array.astype(np.float64)
    except (TypeError, ValueError) as error:
        raise Unreadable(f"it holds Python objects; give numbers or texts: {error}") from None


def _check_times(dtype: np.dtype[Any]) -> None:
    unit, count = np.datetime_data(dtype)
    if unit not in TIME_POWERS or count != 1:
        raise Unreadable(f"it counts {count} {unit}; give one of {', '.join(TIME_POWERS)}, such as .astype('datetime64[ns]')")
