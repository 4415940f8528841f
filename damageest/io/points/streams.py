"""Point files read in pieces, for scans that do not fit into memory: PLY, NPY, LAS, LAZ, E57.

A piece is what `read_points` gives of the same points.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from damageest.artefacts import Floats
from damageest.errors import InputError
from damageest.io.files import raise_environment_fault, shorten_error
from damageest.io.points import FormatError, PointFile
from damageest.io.points.attributes import find_unit

PIECE = 1 << 20
"""Points of a piece at most."""


@dataclass(frozen=True)
class PointStream:
    """A point file: the ``count`` of its points as its header says, and how to read them from the beginning."""

    path: Path
    count: int
    start: Callable[[], Iterator[PointFile]]

    def read(self) -> Iterator[PointFile]:
        """The file piece by piece. Raises InputError, which names the file, where it cannot be read."""
        pieces = self.start()
        while True:
            try:
                piece = next(pieces)
            except StopIteration:
                return
            except Exception as error:  # libraries raise any error on a broken file
                raise _name_fault(self.path, error) from None
            yield piece


def open_stream(path: Path) -> PointStream | None:
    """The file for reading in pieces; None for a format, or a kind of it, that is read as a whole only.

    Raises InputError where its header cannot be read.
    """
    opener = _OPENERS.get(path.suffix.lower())
    if opener is None or not path.is_file():
        return None
    try:
        return opener(path)
    except Exception as error:
        raise _name_fault(path, error) from None


def _name_fault(path: Path, error: Exception) -> InputError:
    raise_environment_fault(error)
    if isinstance(error, FormatError):
        return InputError(f"{path}: {error}")
    return InputError(f"{path}: cannot be read as a {path.suffix.lower()} file ({shorten_error(error)})")


def _open_npy(path: Path) -> PointStream | None:
    with path.open("rb") as stream:
        version = np.lib.format.read_magic(stream)
        read_header = {(1, 0): np.lib.format.read_array_header_1_0}.get(version, np.lib.format.read_array_header_2_0)
        shape, by_columns, kind = read_header(stream)
        begin = stream.tell()
    if by_columns or len(shape) != 2 or shape[1] not in (3, 6) or kind.kind not in "fiu":
        return None
    row = np.dtype((kind, (shape[1],)))
    _check_size(path, begin, shape[0], row.itemsize)

    def start() -> Iterator[PointFile]:
        for piece in _slice(path, begin, shape[0], row):
            yield PointFile(_take(piece[:, :3]), _take(piece[:, 3:]) if shape[1] == 6 else None)

    return PointStream(path, shape[0], start)


def _open_ply(path: Path) -> PointStream | None:
    from damageest.io.points.ply import make_points, read_blocks
    from damageest.io.points.ply_header import read_header

    header = read_header(path)
    vertex = header.vertex
    if header.form != "ascii":
        _check_size(path, header.end, vertex.count, sum(np.dtype(kind).itemsize for _, kind in vertex.properties))
    unit, said = find_unit(header.comments)

    def start() -> Iterator[PointFile]:
        for block in read_blocks(path, header, PIECE):
            yield replace(make_points(block, header), unit=unit, unit_said=said)

    return PointStream(path, vertex.count, start)


def _open_las(path: Path) -> PointStream | None:
    from damageest.io.points.las import open_las, read_colours

    with open_las(path) as reader:
        count = int(reader.header.point_count)

    def start() -> Iterator[PointFile]:
        with open_las(path) as reader:
            for piece in reader.chunk_iterator(PIECE):
                points = np.column_stack([np.asarray(piece.x), np.asarray(piece.y), np.asarray(piece.z)])
                yield PointFile(points, colours=read_colours(piece))

    return PointStream(path, count, start)


def _open_e57(path: Path) -> PointStream | None:
    import pye57

    from damageest.io.points.e57 import MOST_POINTS_PER_BYTE, check_header

    check_header(path)
    with pye57.E57(str(path)) as file:
        count = sum(int(file.get_header(index).point_count) for index in range(file.scan_count))
    if not 0 <= count <= MOST_POINTS_PER_BYTE * path.stat().st_size:
        raise FormatError(f"the file is too small for its {count} points")
    return PointStream(path, count, lambda: _read_e57(path))


def _read_e57(path: Path) -> Iterator[PointFile]:
    """The scans of an E57 file one after the other; which positions are known is decided as where it is read whole."""
    import pye57

    from damageest.io.points.e57 import is_range_image, read_pose, read_scan

    with pye57.E57(str(path)) as file:
        headers = [file.get_header(index) for index in range(file.scan_count)]
        poses = [read_pose(header) for header in headers]
        positions = np.array([pose[:3, 3] for pose in poses]).reshape(-1, 3)
        posed = any(not np.array_equal(pose, np.eye(4)) for pose in poses)
        for index, header in enumerate(headers):
            names = [name for name in header.point_fields if name in pye57.e57.SUPPORTED_POINT_FIELDS]
            data, buffers = file.make_buffers(names, min(PIECE, max(int(header.point_count), 1)))
            reader: Any = header.points.reader(buffers)
            known: bool | None = None
            while got := reader.read():
                raw = {name: values[:got] for name, values in data.items()}
                known = known if known is not None else posed or "sphericalRange" in raw or is_range_image(raw)
                points, normals, colours = read_scan(header, raw, index)
                view = np.full(len(points), index if known else -1)
                yield PointFile(points, normals, "m", viewpoints=positions, view=view, colours=colours)
            reader.close()


_OPENERS: dict[str, Callable[[Path], PointStream | None]] = {
    ".npy": _open_npy,
    ".ply": _open_ply,
    ".las": _open_las,
    ".laz": _open_las,
    ".e57": _open_e57,
}


def _check_size(path: Path, begin: int, count: int, width: int) -> None:
    have = (path.stat().st_size - begin) // width
    if not 0 <= count <= have:
        raise FormatError(f"the file is truncated: it has {max(have, 0)} of {count} points")


def _slice(path: Path, begin: int, count: int, kind: np.dtype[Any]) -> Iterator[Any]:
    with path.open("rb") as stream:
        stream.seek(begin)
        for first in range(0, count, PIECE):
            yield np.fromfile(stream, kind, min(PIECE, count - first))


def _take(columns: Any) -> Floats:
    return np.ascontiguousarray(columns, dtype=np.float64)
