"""Memory that a computation will need, compared with what is free before it is allocated."""

from __future__ import annotations

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
    free = measure_free_memory()
    if needed > free:
        raise StageError(
            f"would need about {format_bytes(needed)} of memory for {what}, but {format_bytes(free)} are free",
            remedy,
            code="memory",
        )
