"""What a process is doing, where the one that started it can read it at any time: a page of memory that both share."""

from __future__ import annotations

import mmap
import os
import struct
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from typing import Any

from damageest.isolation.transfer import make_shared_file

_HEAD = struct.Struct("<IIdi?HHH")
"""Change, job, seconds, status, open, and the length of ``what``, ``owner`` and ``part``, which follow."""
_SIZE = 4096
_PLACE = "damageest_place"
"""The attribute of an error that says what was at work."""


@dataclass(frozen=True)
class Entry:
    """``what`` is at work, as "cluster: dbscan"; ``part``: of it, as the code tells; ``owner``: whose code it is;
    ``seconds``: its time limit, 0 for none.

    ``job`` counts from 0. ``count`` grows with each change, but of the part. ``open`` until the process has ended by
    itself, then with an exit ``status``.
    """

    count: int = 0
    job: int = -1
    seconds: float = 0.0
    status: int = 1
    open: bool = True
    what: str = ""
    owner: str = ""
    part: str = ""


class Page:
    """A page with one entry. ``file``: the number of the open file that another process has opened it with; without
    one, a new page. ``forked``: only forks of this process share it; it needs no file, which a limit of file sizes
    would refuse."""

    def __init__(self, file: int | None = None, forked: bool = False) -> None:
        self.file = -1 if forked else make_shared_file() if file is None else file
        if file is None and not forked:
            os.ftruncate(self.file, _SIZE)
        self._data = mmap.mmap(self.file, _SIZE)
        if file is None:
            self.write(Entry())

    def read(self) -> Entry:
        """The last entry."""
        count, job, seconds, status, is_open, *lengths = _HEAD.unpack_from(self._data, 0)
        texts, start = [], _HEAD.size
        for length in lengths:
            texts.append(self._data[start : start + length].decode(errors="replace"))
            start += length
        return Entry(count, job - 1, seconds, status, is_open, *texts)

    def write(self, entry: Entry) -> None:
        """Replaces the entry."""
        texts = [text.encode()[: _SIZE // 4] for text in (entry.what, entry.owner, entry.part)]
        fixed = (entry.count % 2**32, entry.job + 1, entry.seconds, entry.status, entry.open)
        data = _HEAD.pack(*fixed, *map(len, texts)) + b"".join(texts)
        self._data[: len(data)] = data

    def close(self) -> None:
        self._data.close()
        if self.file >= 0:
            os.close(self.file)


_own: Page | None = None
"""The page of this process, which another one reads; without it, nothing is noted."""


def note_on(page: Page) -> None:
    """Lets this process, and forks of it, note on this page what they do."""
    global _own
    _own = page


@contextmanager
def at_work(what: str, seconds: float = 0.0, owner: str = "") -> Iterator[None]:
    """Notes what is done while the ``with`` block runs, then again what was done before, its time beginning anew.

    The process that reads it ends this one where the block takes longer than ``seconds``; 0 for no limit.
    """
    if _own is None:
        yield
        return
    before = _own.read()
    _change(what=what, seconds=seconds, owner=owner)
    try:
        yield
    except BaseException as error:
        set_place(error, what)
        raise
    finally:
        _change(what=before.what, seconds=before.seconds, owner=before.owner)


def set_place(error: BaseException, what: str) -> None:
    """Keeps what was at work where an error was raised, unless it is known already."""
    if what and not find_place(error):
        with suppress(AttributeError, TypeError):  # an exception of a library that takes no attribute
            setattr(error, _PLACE, what)


def find_place(error: BaseException) -> str:
    """What was at work, as noted, where an error was raised; empty where nothing was. It passes between processes."""
    return str(getattr(error, _PLACE, ""))


def note_job(number: int) -> None:
    """Notes which of several jobs begins."""
    _change(job=number)


def note_part(what: str) -> None:
    """Notes which part of what is at work begins; its time goes on."""
    if _own is not None:
        _own.write(replace(_own.read(), part=what))


def close_entry(status: int, seconds: float = 0.0) -> None:
    """Notes that the process ends by itself, with this exit status, within so many seconds."""
    _change(open=False, seconds=seconds, status=status)


def _change(**values: Any) -> None:
    if _own is not None:
        now = _own.read()
        _own.write(replace(now, count=now.count + 1, part="", **values))
