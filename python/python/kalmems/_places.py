"""Paths with a scheme, such as `s3://bucket/scan.csv`, by fsspec; all others are files of this machine."""

from __future__ import annotations

import contextlib
import os
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from ._needed import needed


def is_remote(path: str | os.PathLike[str]) -> bool:
    """Whether it has a scheme."""
    return isinstance(path, str) and "://" in path


def _of(path: str) -> tuple[Any, str]:
    """The file system and the path within it."""
    system, within = needed("fsspec", "remote").core.url_to_fs(path)
    return system, within


def read(path: str | os.PathLike[str]) -> bytes:
    """The bytes of a file."""
    if not is_remote(path):
        return Path(path).read_bytes()
    system, within = _of(str(path))
    content: bytes = system.cat_file(within)
    return content


def matching(path: str | os.PathLike[str]) -> list[str | os.PathLike[str]]:
    """The files that a pattern with a scheme names; any other path as it is."""
    if not is_remote(path) or not any(sign in str(path) for sign in "*?["):
        return [path]
    system, within = _of(str(path))
    found: list[str | os.PathLike[str]] = [system.unstrip_protocol(one) for one in sorted(system.glob(within))]
    if not found:
        raise ValueError(f"no file matches `{path}`")
    return found


def fetched(path: str | os.PathLike[str], scratch: Path) -> Path:
    """A file of this machine with the content; a copy below `scratch` where the path has a scheme."""
    if not is_remote(path):
        return Path(path)
    system, within = _of(str(path))
    # Files of one name in several folders stay apart.
    copy = scratch / within.strip("/")
    copy.parent.mkdir(parents=True, exist_ok=True)
    system.get_file(within, str(copy))
    return copy


@contextlib.contextmanager
def written(folder: str | os.PathLike[str]) -> Iterator[Path]:
    """A folder of this machine to write results into, with the journal beside it; copied to where the path says if it has a scheme.

    The journal and the results that are there are brought here first, so that the work goes on from them, and both are copied back whatever
    ends it: what is finished stays so.
    """
    if not is_remote(folder):
        yield Path(folder)
        return
    system, within = _of(str(folder).rstrip("/"))
    parent, name = within.rsplit("/", 1) if "/" in within else ("", within)
    with tempfile.TemporaryDirectory() as scratch:
        here, before = Path(scratch) / name, set()
        for beside in (name, f"{name}.journal", f"{name}.unfinished"):
            target = f"{parent}/{beside}"
            if system.exists(target):
                before |= {one[len(parent) + 1 :] for one in system.find(target)}
                system.get(target, str(Path(scratch) / beside), recursive=True)
        try:
            yield here
        finally:
            files = {one.relative_to(scratch).as_posix(): one for one in Path(scratch).rglob("*") if one.is_file()}
            for within, file in sorted(files.items()):
                target = f"{parent}/{within}"
                system.makedirs(target.rsplit("/", 1)[0], exist_ok=True)
                system.put_file(str(file), target)
            # Only when all that is new is there.
            for within in sorted(before - files.keys()):
                system.rm_file(f"{parent}/{within}")
