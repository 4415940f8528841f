"""Calls in a process of their own, for native libraries that may crash, hang or take all memory."""

# The modules:
# worker.py, process.py, serve.py: caller's side, one worker, its own side
# portable.py: start of a worker on systems without inherited files
# interpreter.py: which program runs Python in it
# failures.py: messages of failed calls
# transfer.py: arrays in shared memory
# supervise.py: a process that watches its fork
# shared_notes.py, clock.py, telling.py: what a worker does, since when, in which part of a stage
# parent.py: a process ends with its parent
# limits.py, memory.py: limits, memory that work will need
# one_thread.py, lost_threads.py: linear algebra in one thread; threads of scipy lost for want of memory

from damageest.isolation.failures import ProcessError
from damageest.isolation.limits import Limits, format_bytes, limit_this_process, measure_free_memory, parse_memory
from damageest.isolation.memory import require_memory
from damageest.isolation.one_thread import ONE_THREAD, keep_one_thread
from damageest.isolation.parent import end_with_parent
from damageest.isolation.serve import Usage
from damageest.isolation.shared_notes import at_work, find_place
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
