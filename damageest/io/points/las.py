"""LAS and LAZ, read by laspy, which converts the stored integers with scale and offset to float64."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from damageest.io.points import FormatError, PointFile


def read(path: Path, columns: str | None = None) -> PointFile:
    """All points of the file. laspy gives no unit."""
    import laspy

    size = path.stat().st_size
    with path.open("rb") as stream:
        if stream.read(4) != b"LASF":
            raise FormatError("not a LAS file: it does not start with 'LASF'")
        stream.seek(0)
        with laspy.open(stream, closefd=False) as reader:
            count, width = reader.header.point_count, reader.header.point_format.size
            packed = reader.header.are_points_compressed
            # a wrong count in the header would fill the memory
            if count * width > size * (1000 if packed else 1):
                raise FormatError(f"the file is truncated: it is too small for the {count} points in its header")
            las = reader.read()
    points = np.column_stack([np.asarray(las.x), np.asarray(las.y), np.asarray(las.z)])
    if len(points) < count:
        raise FormatError(f"the file is truncated: it has {len(points)} of {count} points")
    return PointFile(points)
