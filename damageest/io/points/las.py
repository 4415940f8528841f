"""LAS and LAZ, by laspy. Coordinates are stored as scaled integers with an offset and come out as float64."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from damageest.io.points import FormatError, PointFile


def read(path: Path, columns: str | None = None) -> PointFile:
    """All points of the file. LAS states no unit that laspy could give."""
    import laspy

    size = path.stat().st_size
    with path.open("rb") as stream:
        if stream.read(4) != b"LASF":
            raise FormatError("not a LAS file: it does not start with 'LASF'")
        stream.seek(0)
        with laspy.open(stream, closefd=False) as reader:
            count, width = reader.header.point_count, reader.header.point_format.size
            packed = reader.header.are_points_compressed
            # a header that promises more than the file can hold would only exhaust the memory
            if count * width > size * (1000 if packed else 1):
                raise FormatError(f"the file is cut short: its {count} points are not all there")
            las = reader.read()
    points = np.column_stack([np.asarray(las.x), np.asarray(las.y), np.asarray(las.z)])
    if len(points) < count:
        raise FormatError(f"the file is cut short: {len(points)} of {count} points are there")
    return PointFile(points)
