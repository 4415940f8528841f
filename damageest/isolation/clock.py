"""How long another process has been in what it notes."""

from __future__ import annotations

import time

from damageest.isolation.shared_notes import Entry, Page

TICK = 0.5
"""Longest time between two looks, in seconds. A process that is stopped for longer, as by Ctrl-Z, loses no time."""
WALL = 20.0
"""A process whose processor time is limited is late as well after so many limits by the clock on the wall: it may wait
for something that never comes, and then uses no processor."""


class Clock:
    """The time since the last change of ``page``, to be looked at every `TICK`.

    ``process``: its number where the limits are ones of processor time, since a busy machine is no reason to end it.
    Without one they are ones of the clock on the wall.
    """

    @property
    def what(self) -> str:
        """What was at work at the last look."""
        return self._entry.what

    @property
    def told(self) -> str:
        """What is at work, and the part of it that its code tells of."""
        now = self._page.read()
        return ": ".join(filter(None, (now.what, now.part)))

    @property
    def used(self) -> float:
        """Processor seconds of the process until the last look."""
        return self._last - self._first

    def is_exhausted(self) -> bool:
        """Whether the process has used the processor seconds that it has for the whole call."""
        return bool(self._whole) and self._measure() is not None and self.used > self._whole

    def __init__(self, page: Page, process: int | None = None, whole: float = 0.0) -> None:
        """``whole``: processor seconds that the process has for all of the call; 0 for no limit."""
        self._page, self._process, self._whole = page, process, whole
        self._entry = page.read()
        self._start()
        self._first = self._last = self._used or 0.0

    def _start(self) -> None:
        self._spent, self._before, self._used = 0.0, time.monotonic(), self._measure()

    def find_late(self) -> Entry | None:
        """What is at work, where it has been for longer than its time limit; else None."""
        entry, now = self._page.read(), time.monotonic()
        if entry.count != self._entry.count:
            self._entry = entry
            self._start()
            return None
        self._spent += min(now - self._before, 2 * TICK)
        self._before = now
        return entry if entry.seconds and self._is_over(entry.seconds) else None

    def _is_over(self, seconds: float) -> bool:
        used = self._measure()
        if used is None or self._used is None:
            return self._spent > seconds
        return used - self._used > seconds or self._spent > WALL * seconds

    def _measure(self) -> float | None:
        """Processor seconds of the process; None where they do not count, or it has ended."""
        if self._process is None:
            return None
        import psutil

        try:
            times = psutil.Process(self._process).cpu_times()
        except psutil.Error:
            return None
        self._last = float(times.user + times.system)
        return self._last
