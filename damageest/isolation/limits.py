"""Limits of memory and time."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from damageest.errors import InputError

try:
    import resource
except ModuleNotFoundError:
    # As on Windows: --memory is compared with what work will need, but the system limits nothing.
    resource = None  # type: ignore[assignment]

STAGE_SECONDS = 3600.0
"""Default time limit of one isolated call."""
_UNITS = {"": 1, "K": 10**3, "M": 10**6, "G": 10**9, "T": 10**12, "KI": 2**10, "MI": 2**20, "GI": 2**30, "TI": 2**40}
_own_limit: int | None = None
"""What `limit_this_process` was given where the system does not keep it."""
_PROC = Path("/proc")
_CGROUP = Path("/sys/fs/cgroup")


@dataclass(frozen=True)
class Limits:
    """``memory``: bytes that a process may allocate, None for what is free on the machine. ``seconds``: time limit of
    one isolated call, 0 for none. ``of``: what has that time limit, and ``option``: of the command line, which sets it,
    for messages."""

    memory: int | None = None
    seconds: float = STAGE_SECONDS
    of: str = "stage"
    option: str = "--stage-timeout"


def parse_memory(text: str, option: str = "--memory") -> int:
    """Bytes of a size such as ``6GB``, ``512 MiB`` or ``2e9``. Raises InputError for anything else."""
    found = re.fullmatch(r"\s*([0-9]*\.?[0-9]+(?:e[0-9]+)?)\s*([KMGT]I?)?B?\s*", text, re.IGNORECASE)
    size = float(found[1]) * _UNITS[(found[2] or "").upper()] if found else math.nan
    if not 2**20 <= size < 2**60:
        raise InputError(f"{option}: '{text}' is not valid; give a size of at least 1 MB, for example 6GB or 500MB")
    return int(size)


def format_bytes(size: float) -> str:
    """A size as text, such as ``6 GB``."""
    unit = "GB" if size >= 1e9 else "MB"
    return f"{size / (1e9 if unit == 'GB' else 1e6):.3g} {unit}"


def measure_free_memory() -> int:
    """Bytes that can still be allocated: the least of what the machine, its control group (version 1 or 2) and the
    process' own limits of address space (``ulimit -v``) and data (--memory) leave."""
    import psutil  # 20 ms, which a command that measures nothing need not take

    held = psutil.Process().memory_info()
    known = [int(psutil.virtual_memory().available), *_group_free()]
    if resource is not None:
        for limit, used in ((resource.RLIMIT_AS, held.vms), (resource.RLIMIT_DATA, getattr(held, "data", held.rss))):
            most = resource.getrlimit(limit)[0]
            if most != resource.RLIM_INFINITY:
                known.append(most - int(used))
    if _own_limit is not None:
        known.append(_own_limit - int(held.rss))
    return max(0, min(known))


def own_memory() -> int:
    """Bytes that this process holds in memory."""
    import psutil

    return int(psutil.Process().memory_info().rss)


def limit_this_process(memory: int | None) -> None:
    """Lets allocations of this process fail, as MemoryError, where its data would pass ``memory`` bytes.

    Where the system has no such limit, or does not keep it, the limit counts in `measure_free_memory` alone.
    """
    global _own_limit
    if memory is None:
        return
    if resource is None:
        _own_limit = memory
        return
    hard = resource.getrlimit(resource.RLIMIT_DATA)[1]
    if hard != resource.RLIM_INFINITY:
        memory = min(memory, hard)
    try:
        resource.setrlimit(resource.RLIMIT_DATA, (memory, hard))
    except (ValueError, OSError):  # macOS refuses what is less than the process holds
        _own_limit = memory


@contextmanager
def limited(memory: int | None) -> Iterator[None]:
    """Limits this process as `limit_this_process` does, until the end of the ``with`` block."""
    global _own_limit
    before = resource.getrlimit(resource.RLIMIT_DATA) if resource is not None else None
    own = _own_limit
    limit_this_process(memory)
    try:
        yield
    finally:
        _own_limit = own
        if before is not None:
            with suppress(ValueError, OSError):
                resource.setrlimit(resource.RLIMIT_DATA, before)


def _group_free() -> list[int]:
    """What the control group of this process and all groups round it leave. psutil does not know them."""
    try:
        lines = (_PROC / "self/cgroup").read_text().splitlines()
    except OSError:
        return []
    left = []
    for line in lines:
        _, controllers, path = line.split(":", 2)
        if controllers not in ("", "memory") and "memory" not in controllers.split(","):
            continue
        base = _CGROUP if not controllers else _CGROUP / "memory"
        names = ("memory.max", "memory.current") if not controllers else _OLD_NAMES
        # in a container the path may be one of the host, which is not there: its own group is the base then
        own = base / path.lstrip("/")
        for folder in {base, *(place for place in (own, *own.parents) if place.is_relative_to(base))}:
            left += _read_group(folder, *names)
    return left


_OLD_NAMES = ("memory.limit_in_bytes", "memory.usage_in_bytes")


def _read_group(folder: Path, limit: str, usage: str) -> list[int]:
    """What a control group leaves; empty for one without a limit. Cached files count as free."""
    try:
        most, used = int((folder / limit).read_text()), int((folder / usage).read_text())
        found = re.search(r"^(?:total_)?inactive_file (\d+)$", (folder / "memory.stat").read_text(), re.MULTILINE)
    except (OSError, ValueError):  # no such group, or the word max
        return []
    return [most - used + (int(found[1]) if found else 0)] if most < 2**60 else []
