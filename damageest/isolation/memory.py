"""Memory that a computation will need, compared with what is free before it is allocated."""

from __future__ import annotations

import resource
from pathlib import Path

from damageest.errors import StageError
from damageest.isolation.limits import format_bytes, measure_free_memory

WORTH_ASKING = 10 * 10**6
"""Bytes below which free memory is not checked: the check would cost more than it saves."""


FEWER_POINTS = "fewer scan points (scan.most_points), or more memory (--memory)"
"""The remedy where the memory follows the number of scan points."""


def require_memory(needed: float, what: str, remedy: str) -> None:
    """Raises StageError where ``needed`` bytes are not free, with both figures, ``what`` needs them, and the remedy.

    Free is the least of what the machine, its control group, the process' limits (``ulimit -v``) and --memory leave.
    """
    if needed < WORTH_ASKING:
        return
    known = [free for free in (measure_free_memory(), _measure_free_data()) if free is not None]
    if known and needed > min(known):
        raise StageError(
            f"would need about {format_bytes(needed)} of memory for {what}, but {format_bytes(max(min(known), 0))} are "
            "free",
            remedy,
        )


def _measure_free_data() -> int | None:
    """Bytes that the limit of the process' data leaves, which --memory sets; None where there is no limit."""
    most = resource.getrlimit(resource.RLIMIT_DATA)[0]
    if most == resource.RLIM_INFINITY:
        return None
    try:
        lines = Path("/proc/self/status").read_text().splitlines()
        return most - next(int(line.split()[1]) * 1024 for line in lines if line.startswith("VmData"))
    except (OSError, StopIteration, ValueError):
        return most
