"""What a process is doing, where its parent can read it after a crash: a page of memory that both share."""

from __future__ import annotations

import mmap
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any

_HEAD = struct.Struct("<IIdi?HH")
"""Change, job, seconds, status, open, and the length of ``what`` and ``owner``, which follow."""
_SIZE = 4096
_page: mmap.mmap | None = None


@dataclass(frozen=True)
class Entry:
    """``what`` is at work, as "cluster: dbscan"; ``owner``: whose code it is; ``seconds``: its time limit, 0 for none.

    ``job`` counts from 0. ``count`` grows with each change. ``open`` until the process has ended by
    itself, then with an exit ``status``.
    """

    count: int = 0
    job: int = -1
    seconds: float = 0.0
    status: int = 1
    open: bool = True
    what: str = ""
    owner: str = ""


def share_page() -> None:
    """Makes the page. A process that is forked afterwards shares it; without it, nothing is noted."""
    global _page
    _page = mmap.mmap(-1, _SIZE)
    _write(Entry())


def read_entry() -> Entry:
    """The last entry."""
    if _page is None:
        return Entry()
    *head, length, other = _HEAD.unpack_from(_page, 0)
    start, end = _HEAD.size, _HEAD.size + length
    what, owner = (part.decode(errors="replace") for part in (_page[start:end], _page[end : end + other]))
    count, job, seconds, status, is_open = head
    return Entry(count, job - 1, seconds, status, is_open, what, owner)


@contextmanager
def at_work(what: str, seconds: float = 0.0, owner: str = "") -> Iterator[None]:
    """Notes what is done while the ``with`` block runs, then again what was done before, its time beginning anew."""
    if _page is None:
        yield
        return
    before = read_entry()
    _change(what=what, seconds=seconds, owner=owner)
    try:
        yield
    finally:
        _change(what=before.what, seconds=before.seconds, owner=before.owner)


def note_job(number: int) -> None:
    """Notes which of several jobs begins."""
    _change(job=number)


def close_entry(status: int, seconds: float = 0.0) -> None:
    """Notes that the process ends by itself, with this exit status, within so many seconds."""
    _change(open=False, seconds=seconds, status=status)


def _change(**values: Any) -> None:
    if _page is not None:
        now = read_entry()
        _write(replace(now, count=now.count + 1, **values))


def _write(entry: Entry) -> None:
    assert _page is not None
    what, owner = (text.encode()[: _SIZE // 3] for text in (entry.what, entry.owner))
    fixed = (entry.count % 2**32, entry.job + 1, entry.seconds, entry.status, entry.open)
    data = _HEAD.pack(*fixed, len(what), len(owner)) + what + owner
    _page[: len(data)] = data
