"""Calls in a process of their own, for native libraries that may crash, hang or take all memory."""

from damageest.isolation.failures import ProcessError
from damageest.isolation.limits import Limits, format_bytes, limit_this_process, measure_free_memory, parse_memory
from damageest.isolation.memory import require_memory
from damageest.isolation.notes import at_work
from damageest.isolation.worker import call_isolated, cpu_seconds, end_workers

__all__ = [
    "Limits",
    "ProcessError",
    "at_work",
    "call_isolated",
    "cpu_seconds",
    "end_workers",
    "format_bytes",
    "limit_this_process",
    "measure_free_memory",
    "parse_memory",
    "require_memory",
]
