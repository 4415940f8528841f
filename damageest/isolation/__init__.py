"""Calls in a process of their own, for native libraries that may crash, hang or take all memory."""

from damageest.isolation.failures import ProcessError
from damageest.isolation.limits import Limits, format_bytes, limit_this_process, measure_free_memory, parse_memory
from damageest.isolation.memory import require_memory
from damageest.isolation.notes import at_work, find_place
from damageest.isolation.one_thread import ONE_THREAD, keep_one_thread
from damageest.isolation.parent import end_with_parent
from damageest.isolation.serve import Usage
from damageest.isolation.telling import listen, tell_part
from damageest.isolation.worker import call_isolated, cpu_seconds, end_workers

__all__ = [
    "ONE_THREAD",
    "Limits",
    "ProcessError",
    "Usage",
    "at_work",
    "call_isolated",
    "cpu_seconds",
    "end_with_parent",
    "end_workers",
    "find_place",
    "format_bytes",
    "keep_one_thread",
    "limit_this_process",
    "listen",
    "measure_free_memory",
    "parse_memory",
    "require_memory",
    "tell_part",
]
