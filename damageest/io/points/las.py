"""LAS and LAZ, read by laspy, which converts the stored integers with scale and offset to float64."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np

from damageest.artefacts import Bytes
from damageest.io.points import FormatError, PointFile
from damageest.io.points.attributes import scale_colours

if TYPE_CHECKING:
    from laspy import LasReader

HEAD = 375
"""Bytes of the longest header, that of LAS 1.4."""


def read(path: Path, columns: str | None = None) -> PointFile:
    """All points of the file. laspy gives no unit."""
    with open_las(path) as reader:
        count = reader.header.point_count
        las = reader.read()
    points = np.column_stack([np.asarray(las.x), np.asarray(las.y), np.asarray(las.z)])
    if len(points) < count:
        raise FormatError(f"the file is truncated: it has {len(points)} of {count} points")
    return PointFile(points, colours=read_colours(las))


def read_colours(las: Any) -> Bytes | None:
    """Colours (N,3) of points, None where their format has none. They have 16 bits by the standard; programs that write
    8 bits into them are known by their values."""
    if "red" not in las.point_format.dimension_names:
        return None
    return scale_colours(np.column_stack([np.asarray(las.red), np.asarray(las.green), np.asarray(las.blue)]))


@contextmanager
def open_las(path: Path) -> Iterator[LasReader]:
    """laspy's reader of a file, after its header was checked. Raises FormatError for numbers that cannot be."""
    import laspy

    size = path.stat().st_size
    with path.open("rb") as stream:
        _check_header(stream.read(HEAD), stream, size)
        stream.seek(0)
        # the parallel decompressor allocates what a wrong size or table of the pieces says, and aborts where that fails
        with laspy.open(stream, closefd=False, laz_backend=laspy.LazBackend.Lazrs) as reader:
            count, width = reader.header.point_count, reader.header.point_format.size
            packed = reader.header.are_points_compressed
            # a wrong count in the header would fill the memory
            if count * width > size * (1000 if packed else 1):
                raise FormatError(f"the file is truncated: it is too small for the {count} points in its header")
            yield reader


def _check_header(head: bytes, stream: BinaryIO, size: int) -> None:
    """Raises FormatError for numbers of records that the file is too small for: reading them would have no end."""
    if head[:4] != b"LASF":
        raise FormatError("not a LAS file: it does not start with 'LASF'")
    if len(head) < 227:
        raise FormatError("the file is truncated: it ends in its header")
    length, start, records = struct.unpack_from("<HII", head, 94)
    if not 227 <= length <= start <= size or length + records * 54 > start:
        raise FormatError(f"the file is truncated, or its header is wrong: it has no room for {records} records")
    if head[25] >= 4 and len(head) == HEAD:
        first, count = struct.unpack_from("<QI", head, 235)
        if count and first + count * 60 > size:
            raise FormatError(f"the file is truncated, or its header is wrong: it has no room for {count} records")
    if head[104] & 0xC0:
        _check_chunks(stream, start, size)


def _check_chunks(stream: BinaryIO, start: int, size: int) -> None:
    """Raises FormatError where the table of a LAZ file's compressed pieces cannot be in the file."""
    stream.seek(start)
    (table,) = struct.unpack("<q", stream.read(8).ljust(8, b"\0"))
    if table == -1:  # it was not known when the file was begun, and is at the end
        stream.seek(max(size - 8, 0))
        (table,) = struct.unpack("<q", stream.read(8).ljust(8, b"\0"))
    if not start < table <= size - 8:
        raise FormatError("the file is truncated: its table of compressed pieces is missing")
    stream.seek(table)
    _, count = struct.unpack("<II", stream.read(8))
    if count > size:
        raise FormatError(f"the table of compressed pieces is wrong: the file has no room for {count} of them")
