"""Limits of memory and time."""

from __future__ import annotations

import math
import os
import re
import resource
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from damageest.errors import InputError

STAGE_SECONDS = 3600.0
"""Default time limit of one isolated call."""
_UNITS = {"": 1, "K": 10**3, "M": 10**6, "G": 10**9, "T": 10**12, "KI": 2**10, "MI": 2**20, "GI": 2**30, "TI": 2**40}
_PROC = Path("/proc")
_CGROUP = Path("/sys/fs/cgroup")


@dataclass(frozen=True)
class Limits:
    """``memory``: bytes that a process may allocate, None for what is free on the machine. ``seconds``: time limit of
    one isolated call, 0 for none."""

    memory: int | None = None
    seconds: float = STAGE_SECONDS


def parse_memory(text: str, option: str = "--memory") -> int:
    """Bytes of a size such as ``6GB``, ``512 MiB`` or ``2e9``. Raises InputError for anything else."""
    found = re.fullmatch(r"\s*([0-9]*\.?[0-9]+(?:e[0-9]+)?)\s*([KMGT]I?)?B?\s*", text, re.IGNORECASE)
    size = float(found[1]) * _UNITS[(found[2] or "").upper()] if found else math.nan
    if not 2**20 <= size < 2**60:
        raise InputError(f"{option}: '{text}' is not valid; give a size of at least 1 MB, as 6GB or 500MB")
    return int(size)


def format_bytes(size: float) -> str:
    """A size as text, such as ``6 GB``."""
    unit = "GB" if size >= 1e9 else "MB"
    return f"{size / (1e9 if unit == 'GB' else 1e6):.3g} {unit}"


def measure_free_memory() -> int | None:
    """Bytes that can still be allocated: the least of what the machine, its control group (version 1 or 2) and the
    process' own limit of address space (``ulimit -v``) leave. None where the system gives none of them."""
    known = [value for value in (_machine_free(), _group_free(), _address_space_free()) if value is not None]
    return max(0, min(known)) if known else None


def own_memory() -> int:
    """Bytes that this process holds in memory; 0 where the system does not tell."""
    try:
        return int((_PROC / "self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")
    except (OSError, ValueError, IndexError):
        return 0


def limit_this_process(memory: int | None) -> None:
    """Lets allocations of this process fail, as MemoryError, where its data would pass ``memory`` bytes."""
    if memory is None:
        return
    hard = resource.getrlimit(resource.RLIMIT_DATA)[1]
    if hard != resource.RLIM_INFINITY:
        memory = min(memory, hard)
    resource.setrlimit(resource.RLIMIT_DATA, (memory, hard))


@contextmanager
def limited(memory: int | None) -> Iterator[None]:
    """Limits this process as `limit_this_process` does, until the end of the ``with`` block."""
    before = resource.getrlimit(resource.RLIMIT_DATA)
    limit_this_process(memory)
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_DATA, before)


def _machine_free() -> int | None:
    try:
        found = re.search(r"^MemAvailable:\s+(\d+) kB", (_PROC / "meminfo").read_text(), re.MULTILINE)
    except OSError:
        return None
    return int(found[1]) * 1024 if found else None


def _group_free() -> int | None:
    """Of the control group of this process and all groups round it, the least free."""
    try:
        lines = (_PROC / "self/cgroup").read_text().splitlines()
    except OSError:
        return None
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
    return min(left, default=None)


_OLD_NAMES = ("memory.limit_in_bytes", "memory.usage_in_bytes")


def _read_group(folder: Path, limit: str, usage: str) -> list[int]:
    """What a control group leaves; empty for one without a limit. Cached files count as free."""
    try:
        most, used = int((folder / limit).read_text()), int((folder / usage).read_text())
        found = re.search(r"^(?:total_)?inactive_file (\d+)$", (folder / "memory.stat").read_text(), re.MULTILINE)
    except (OSError, ValueError):  # no such group, or the word max
        return []
    return [most - used + (int(found[1]) if found else 0)] if most < 2**60 else []


def _address_space_free() -> int | None:
    most = resource.getrlimit(resource.RLIMIT_AS)[0]
    if most == resource.RLIM_INFINITY:
        return None
    try:
        return most - int((_PROC / "self/statm").read_text().split()[0]) * os.sysconf("SC_PAGE_SIZE")
    except (OSError, ValueError, IndexError):
        return most
