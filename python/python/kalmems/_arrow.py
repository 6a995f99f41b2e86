"""Columns of numbers as a stream of the Arrow C data interface, which any library of tables takes without a copy and without pyarrow.

https://arrow.apache.org/docs/format/CStreamInterface.html says what the structures are. A consumer moves them in memory and releases each by
itself, so that what each needs is held here by a number that travels with it.
"""

from __future__ import annotations

import ctypes
import itertools
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

_NAME = b"arrow_array_stream"
# The flag of a column that may have nulls, as pyarrow and others describe their own.
_NULLABLE = 2
_INVALID = 22
"""The error number of an argument that cannot be used."""

_held: dict[int, Any] = {}
_numbers = itertools.count(1)


class _Schema(ctypes.Structure):
    pass


class _Array(ctypes.Structure):
    pass


class _Stream(ctypes.Structure):
    pass


_ReleaseSchema = ctypes.CFUNCTYPE(None, ctypes.POINTER(_Schema))
_ReleaseArray = ctypes.CFUNCTYPE(None, ctypes.POINTER(_Array))
_ReleaseStream = ctypes.CFUNCTYPE(None, ctypes.POINTER(_Stream))
_GetSchema = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.POINTER(_Stream), ctypes.POINTER(_Schema))
_GetNext = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.POINTER(_Stream), ctypes.POINTER(_Array))
_GetLastError = ctypes.CFUNCTYPE(ctypes.c_void_p, ctypes.POINTER(_Stream))
# Called with the lock of the interpreter, by an object that has no reference any more.
_Destructor = ctypes.PYFUNCTYPE(None, ctypes.c_void_p)

_Schema._fields_ = [
    ("format", ctypes.c_char_p),
    ("name", ctypes.c_char_p),
    ("metadata", ctypes.c_char_p),
    ("flags", ctypes.c_int64),
    ("n_children", ctypes.c_int64),
    ("children", ctypes.POINTER(ctypes.POINTER(_Schema))),
    ("dictionary", ctypes.POINTER(_Schema)),
    ("release", _ReleaseSchema),
    ("private_data", ctypes.c_void_p),
]
_Array._fields_ = [
    ("length", ctypes.c_int64),
    ("null_count", ctypes.c_int64),
    ("offset", ctypes.c_int64),
    ("n_buffers", ctypes.c_int64),
    ("n_children", ctypes.c_int64),
    ("buffers", ctypes.POINTER(ctypes.c_void_p)),
    ("children", ctypes.POINTER(ctypes.POINTER(_Array))),
    ("dictionary", ctypes.POINTER(_Array)),
    ("release", _ReleaseArray),
    ("private_data", ctypes.c_void_p),
]
_Stream._fields_ = [
    ("get_schema", _GetSchema),
    ("get_next", _GetNext),
    ("get_last_error", _GetLastError),
    ("release", _ReleaseStream),
    ("private_data", ctypes.c_void_p),
]


def _hold(*what: Any) -> int:
    number = next(_numbers)
    _held[number] = what
    return number


def _release_with_children(pointer: Any) -> None:
    """Releases a schema or an array, and those of its children that nobody has taken."""
    own = pointer.contents
    for place in range(own.n_children):
        child = own.children[place]
        if child.contents.release:
            child.contents.release(child)
    _held.pop(own.private_data, None)
    own.release = type(own.release)()


_release_schema = _ReleaseSchema(_release_with_children)
_release_array = _ReleaseArray(_release_with_children)


def _described(schema: Any, form: bytes, name: bytes, children: list[Any]) -> None:
    pointers = (ctypes.POINTER(_Schema) * len(children))(*map(ctypes.pointer, children))
    schema.format, schema.name, schema.metadata, schema.flags = form, name, None, _NULLABLE
    schema.n_children, schema.children = len(children), pointers
    schema.dictionary, schema.release = None, _release_schema
    schema.private_data = _hold(form, name, children, pointers)


def _filled(array: Any, length: int, buffers: list[int | None], children: list[Any], owner: Any) -> None:
    addresses = (ctypes.c_void_p * len(buffers))(*buffers)
    pointers = (ctypes.POINTER(_Array) * len(children))(*map(ctypes.pointer, children))
    array.length, array.null_count, array.offset = length, 0, 0
    array.n_buffers, array.buffers = len(buffers), addresses
    array.n_children, array.children = len(children), pointers
    array.dictionary, array.release = None, _release_array
    array.private_data = _hold(addresses, children, pointers, owner)


def _get_schema(stream: Any, schema: Any) -> int:
    try:
        columns, _ = _held[stream.contents.private_data]
        children = [_Schema() for _ in columns]
        for child, name in zip(children, columns, strict=True):
            _described(child, b"g", name.encode(), [])
        _described(schema.contents, b"+s", b"", children)
    except Exception:
        return _INVALID
    return 0


def _get_next(stream: Any, array: Any) -> int:
    try:
        columns, rest = _held[stream.contents.private_data]
        if not rest:
            # The end of the stream is an array that is released.
            array.contents.release = _ReleaseArray()
            return 0
        rest.clear()
        children = [_Array() for _ in columns]
        for child, values in zip(children, columns.values(), strict=True):
            _filled(child, len(values), [None, values.ctypes.data], [], values)
        length = len(next(iter(columns.values()), ()))
        _filled(array.contents, length, [None], children, None)
    except Exception:
        return _INVALID
    return 0


def _release_stream(pointer: Any) -> None:
    _held.pop(pointer.contents.private_data, None)
    pointer.contents.release = _ReleaseStream()


def _destroyed(capsule: int) -> None:
    """Releases a stream that nobody has taken."""
    address = _pointer_of(capsule, _NAME)
    stream = _held.pop(-address)[0]
    if stream.release:
        stream.release(ctypes.pointer(stream))


_callbacks = (
    _GetSchema(_get_schema),
    _GetNext(_get_next),
    _GetLastError(lambda _: None),
    _ReleaseStream(_release_stream),
    _Destructor(_destroyed),
)
_new_capsule = ctypes.pythonapi.PyCapsule_New
_new_capsule.restype, _new_capsule.argtypes = ctypes.py_object, [ctypes.c_void_p, ctypes.c_char_p, _Destructor]
_pointer_of = ctypes.pythonapi.PyCapsule_GetPointer
_pointer_of.restype, _pointer_of.argtypes = ctypes.c_void_p, [ctypes.c_void_p, ctypes.c_char_p]
# A consumer may keep what it was given for longer than this module lives.
for _callback in (*_callbacks, _release_schema, _release_array):
    ctypes.pythonapi.Py_IncRef(ctypes.py_object(_callback))


def stream(columns: Mapping[str, NDArray[np.float64]]) -> Any:
    """A capsule with a stream of one batch of these columns, which share their memory and keep it alive."""
    own = {name: np.ascontiguousarray(values, dtype=np.float64) for name, values in columns.items()}
    get_schema, get_next, get_last_error, release, destructor = _callbacks
    made = _Stream(get_schema, get_next, get_last_error, release, _hold(own, [True]))
    _held[-ctypes.addressof(made)] = (made,)
    return _new_capsule(ctypes.addressof(made), _NAME, destructor)
