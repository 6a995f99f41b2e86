"""Parts of a study on the workers of an executor, some of which die or hang."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ._study import Part

LOOK_S = 0.05
"""How often futures are asked whether they are done."""
LEAST_S = 60.0
"""How long no part may be finished, at least, before those that are missing are given out again."""
TIMES = 10.0
"""The same in multiples of the longest time until now."""
FAILURES = 5
"""How often a part may fail before that is told."""


class Attempt:
    """A part that was given to an executor once.

    What it gives is fetched on a thread of its own: it may lie on a worker that hangs since it was done.
    """

    def __init__(self, executor: Any, part: Part, number: int) -> None:
        self._future = executor.submit(attempt, part, number)
        self._thread: threading.Thread | None = None
        self.result: bytes | None = None
        self.error: BaseException | None = None

    def look(self) -> None:
        """Fetches the result once the part is done."""
        if self._thread is None and self._future.done():
            self._thread = threading.Thread(target=self._fetch, daemon=True)
            self._thread.start()

    def _fetch(self) -> None:
        try:
            self.result = self._future.result()
        except BaseException as error:
            # A worker that died takes its work with it; what the part itself raises, it raises each time.
            self.error = error

    def cancel(self) -> None:
        """Where it hangs, or is not needed any more."""
        self._future.cancel()


def finished(
    executor: Any, parts: Sequence[Part], deadline: float | None, progress: Callable[[str, int, int], object] | None
) -> list[bytes]:
    """What each part gives, in their order.

    Of `submit` and of what that returns nothing is used but `done`, `result` and `cancel`, which all executors have.
    """
    attempts = [[Attempt(executor, part, 1)] for part in parts]
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
                        attempts[place].append(Attempt(executor, parts[place], len(attempts[place]) + 1))
                last, waits = time.monotonic(), waits + 1
            time.sleep(LOOK_S)
    finally:
        for each in attempts:
            for one in each:
                one.cancel()
    return [found[place] for place in range(len(parts))]


def attempt(part: Part, number: int) -> bytes:
    """A part, given out for the time of this number: to an executor that knows work by its arguments, each time is other work."""
    return part.run()


def _first_done(executor: Any, part: Part, attempts: list[Attempt]) -> bytes | None:
    """What the first attempt that is done gives. Where all failed, the part is given out again, but for the last time."""
    failed: list[BaseException] = []
    for one in attempts:
        one.look()
        if one.result is not None:
            return one.result
        if one.error is not None:
            failed.append(one.error)
    if len(failed) == len(attempts):
        if len(failed) >= FAILURES:
            raise failed[-1]
        attempts.append(Attempt(executor, part, len(attempts) + 1))
    return None
