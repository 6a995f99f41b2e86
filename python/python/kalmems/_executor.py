"""Parts of a study on the workers of an executor, some of which die or hang."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ._study import Part

LOOK_S = 0.02
"""How often futures are asked whether they are done."""
LEAST_S = 60.0
"""How long no part may be finished, at least, before those that are missing are given out again."""
TIMES = 10.0
"""The same in multiples of the longest time until now."""
FAILURES = 5
"""How often a part may fail before that is told."""


def finished(
    executor: Any, parts: Sequence[Part], deadline: float | None, progress: Callable[[str, int, int], object] | None
) -> list[bytes]:
    """What each part gives, in their order.

    Of `submit` and of what that returns nothing is used but `done`, `result` and `cancel`, which all executors have.
    """
    attempts: list[list[Any]] = [[executor.submit(attempt, part, 1)] for part in parts]
    found: dict[int, bytes] = {}
    last, longest, waits = time.monotonic(), 0.0, 0
    try:
        while len(found) < len(parts):
            for place in range(len(parts)):
                if place in found:
                    continue
                given = _first_done(executor, parts[place], attempts[place])
                if given is None:
                    continue
                found[place] = given
                now = time.monotonic()
                longest, last, waits = max(longest, now - last), now, 0
                if progress is not None:
                    progress("studying", len(found), len(parts))
            patience = max(LEAST_S, TIMES * longest) if deadline is None else deadline
            # Longer from time to time: it may come to a worker that hangs, or before another has joined.
            if len(found) < len(parts) and time.monotonic() - last > patience * 2**waits:
                for place in range(len(parts)):
                    if place not in found:
                        attempts[place].append(executor.submit(attempt, parts[place], len(attempts[place]) + 1))
                last, waits = time.monotonic(), waits + 1
            time.sleep(LOOK_S)
    finally:
        # Those that hang, or that are not needed any more.
        for futures in attempts:
            for future in futures:
                future.cancel()
    return [found[place] for place in range(len(parts))]


def attempt(part: Part, number: int) -> bytes:
    """A part, given out for the time of this number: to an executor that knows work by its arguments, each time is other work."""
    return part.run()


def _first_done(executor: Any, part: Part, futures: list[Any]) -> bytes | None:
    """What the first future that is done gives. Where all failed, the part is given out again, but for the last time."""
    failed: list[Exception] = []
    for future in futures:
        if not future.done():
            continue
        try:
            result: bytes = future.result()
            return result
        except Exception as error:
            # A worker that died takes its work with it; what the part itself raises, it raises each time.
            failed.append(error)
    if len(failed) == len(futures):
        if len(failed) >= FAILURES:
            raise failed[-1]
        futures.append(executor.submit(attempt, part, len(futures) + 1))
    return None
