"""Values between two processes, their arrays in shared memory.

A value is pickled with protocol 5. The pickle and, out of band, the arrays go into an anonymous file in memory, whose
descriptor is sent through a socket. Nothing is left of it where a process is killed.
"""

from __future__ import annotations

import dataclasses
import io
import mmap
import os
import pickle
import socket
import struct
import tempfile
from collections.abc import Sequence
from typing import Any

_ALIGNED = 64
"""Bytes to which the arrays are aligned."""
SHARES_FILES = os.name == "posix" and hasattr(socket, "send_fds") and hasattr(os, "preadv")
"""Whether an open file can be given to another process; where not, values are sent as bytes."""
LARGE = 1 << 24
"""Bytes of a value from which on it is mapped and not copied."""


def send(channel: socket.socket, value: Any) -> None:
    """Sends a value. Raises what pickling raises, and then has sent nothing."""
    buffers: list[pickle.PickleBuffer] = []
    stream = io.BytesIO()
    _Pickler(stream, protocol=5, buffer_callback=buffers.append).dump(value)
    parts = [stream.getbuffer(), *(buffer.raw() for buffer in buffers)]
    starts = _place([part.nbytes for part in parts])
    if not SHARES_FILES:
        channel.sendall(struct.pack(f"<{len(parts) + 1}Q", len(parts), *(part.nbytes for part in parts)))
        for part in parts:
            channel.sendall(part)
        return
    file = make_shared_file()
    try:
        os.ftruncate(file, starts[-1])
        sizes = struct.pack(f"<{len(parts) + 1}Q", len(parts), *(part.nbytes for part in parts))
        # written, not copied into a map of the file, which would cost a page fault for each page
        for start, part in zip((0, *starts), (memoryview(sizes), *parts), strict=False):
            _write(file, part, start)
        socket.send_fds(channel, [b"v"], [file])
    finally:
        os.close(file)


def receive(channel: socket.socket, copy: bool) -> Any:
    """The next value. Its arrays lie in the shared memory, or with ``copy`` in this process' own; those of a large
    value lie in a private map of the shared memory, which behaves alike.

    A map keeps a file open until its arrays are gone. Raises EOFError where the other process has ended.
    """
    return load(receive_parts(channel, copy))


def receive_parts(channel: socket.socket, copy: bool) -> list[Any]:
    """The parts of the next value, for `load`. Raises EOFError where the other process has ended."""
    if not SHARES_FILES:
        count = struct.unpack("<Q", receive_bytes(channel, 8))[0]
        return [receive_bytes(channel, size) for size in struct.unpack(f"<{count}Q", receive_bytes(channel, 8 * count))]
    try:
        word, files, _, _ = socket.recv_fds(channel, 1, 1)
    except ConnectionError:
        word, files = b"", []
    if not word or not files:
        raise EOFError
    file = files[0]
    try:
        count = struct.unpack("<Q", os.pread(file, 8, 0))[0]
        sizes = struct.unpack(f"<{count}Q", os.pread(file, 8 * count, 8))
        starts = _place(sizes)
        if copy and starts[-1] < LARGE:
            parts: list[Any] = [bytearray(size) for size in sizes]
            for start, part in zip(starts, parts, strict=False):
                _read(file, memoryview(part), start)
            return parts
        # a page of a private map is copied where it is written to; to populate it would copy all
        flags = mmap.MAP_PRIVATE if copy else mmap.MAP_SHARED | getattr(mmap, "MAP_POPULATE", 0)
        view = memoryview(mmap.mmap(file, 0, flags, mmap.PROT_READ | mmap.PROT_WRITE))
        return [view[start : start + size] for start, size in zip(starts, sizes, strict=False)]
    finally:
        os.close(file)


def receive_bytes(channel: socket.socket, size: int) -> bytearray:
    """So many bytes. Raises EOFError where the other process has ended."""
    data = bytearray(size)
    view, done = memoryview(data), 0
    while done < size:
        try:
            got = channel.recv_into(view[done : done + (1 << 24)])
        except ConnectionError:
            got = 0
        if not got:
            raise EOFError
        done += got
    return data


def _write(file: int, part: memoryview, start: int) -> None:
    """Writes all of a part at an offset; the system may write less at a time, as 2 GB."""
    done = 0
    while done < part.nbytes:
        done += os.pwrite(file, part[done:], start + done)


def _read(file: int, part: memoryview, start: int) -> None:
    done = 0
    while done < part.nbytes:
        done += os.preadv(file, [part[done:]], start + done)


def load(parts: Sequence[Any]) -> Any:
    """The value of `receive_parts`. Raises what unpickling raises, such as ImportError for its class."""
    return pickle.loads(parts[0], buffers=parts[1:])


def _place(sizes: Sequence[int]) -> list[int]:
    """Where each part starts behind the table of sizes, and where the last one ends."""
    starts, end = [], 8 * (len(sizes) + 1)
    for size in sizes:
        starts.append(-(-end // _ALIGNED) * _ALIGNED)
        end = starts[-1] + size
    return [*starts, end]


def make_shared_file() -> int:
    """The number of a new open file in memory, which this process closes."""
    if hasattr(os, "memfd_create"):
        return os.memfd_create("damageest")
    with tempfile.TemporaryFile() as file:
        return os.dup(file.fileno())


class _Pickler(pickle.Pickler):
    """Sends the fields of dataclasses alone: what they have cached is computed again where it is needed."""

    def reducer_override(self, obj: Any) -> Any:
        kind = type(obj)
        if dataclasses.is_dataclass(kind) and "__reduce__" not in vars(kind) and not issubclass(kind, BaseException):
            return _rebuild, (kind, {field.name: getattr(obj, field.name) for field in dataclasses.fields(obj)})
        return NotImplemented


def _rebuild(kind: type, fields: dict[str, Any]) -> Any:
    """A dataclass as it was. Its checks are not repeated: the sender has passed them."""
    value: Any = object.__new__(kind)
    for name, field in fields.items():
        object.__setattr__(value, name, field)
    return value
