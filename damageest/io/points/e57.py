"""E57 (ASTM E2807), read by pye57: lengths in metres, any number of scans, each with its pose."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import numpy as np

from damageest.artefacts import Bytes, Floats
from damageest.io.points import FormatError, PointFile
from damageest.io.points.attributes import scale_colours

MOST_POINTS_PER_BYTE = 8
"""Coordinates are packed in bits; a point takes at least one."""


def read(path: Path, columns: str | None = None) -> PointFile:
    """The points of all scans in the common frame of the file, without those that are marked as invalid.

    The scanner position of a scan is the origin of its own frame, moved by its pose. Programs also write scans that
    they have moved or merged, with a pose that changes nothing. So the position is known only where the scan has a pose
    that changes something, rows and columns, or spherical coordinates, or where another scan of the file has such a
    pose.
    """
    import pye57

    check_header(path)
    pieces: list[Floats] = []
    normals: list[Floats | None] = []
    positions: list[Floats] = []
    known: list[bool] = []
    colours: list[Bytes | None] = []
    posed = False
    with pye57.E57(str(path)) as file:
        for index in range(file.scan_count):
            header = file.get_header(index)
            if not 0 <= header.point_count <= MOST_POINTS_PER_BYTE * path.stat().st_size:
                raise FormatError(f"the file is too small for the {header.point_count} points of scan {index + 1}")
            raw = file.read_scan_raw(index)
            points, normal, colour = read_scan(header, raw, index)
            pieces.append(points)
            normals.append(normal)
            colours.append(colour)
            pose = read_pose(header)
            positions.append(pose[:3, 3])
            known.append("sphericalRange" in raw or is_range_image(raw))
            posed |= not np.array_equal(pose, np.eye(4))
    if not pieces:
        raise FormatError("the E57 file has no scans")
    whole, coloured = [n for n in normals if n is not None], [c for c in colours if c is not None]
    notes = (f"{len(pieces)} scans in one E57 file",) if len(pieces) > 1 else ()
    numbers = np.where(np.array(known) | posed, np.arange(len(pieces)), -1)
    return PointFile(
        np.concatenate(pieces),
        np.concatenate(whole) if len(whole) == len(normals) else None,
        unit="m",
        notes=notes,
        viewpoints=np.array(positions) if (numbers >= 0).any() else None,
        view=np.repeat(numbers, [len(piece) for piece in pieces]) if (numbers >= 0).any() else None,
        colours=np.concatenate(coloured) if len(coloured) == len(colours) else None,
    )


def check_header(path: Path) -> None:
    """Raises FormatError for a file that is not whole, or whose XML declares entities, which may expand without end."""
    size = path.stat().st_size
    with path.open("rb") as stream:
        head = stream.read(48)
        if head[:8] != b"ASTM-E57":
            raise FormatError("not an E57 file: it does not start with 'ASTM-E57'")
        if len(head) < 48:
            raise FormatError("the file is truncated: it ends in its header")
        length, start, count, page = struct.unpack_from("<QQQQ", head, 16)
        if length > size:
            raise FormatError(f"the file is truncated: it has {size} of {length} bytes")
        if start >= size or count > size or not 0 < page <= 2**20:
            raise FormatError("the header of the E57 file is not valid")
        stream.seek(start)
        xml = stream.read(min(count + 4 * (count // page + 2), size))
    if b"<!DOCTYPE" in xml or b"<!ENTITY" in xml:
        raise FormatError("the XML of the E57 file declares entities, which no E57 file needs")


def read_pose(header: Any) -> Floats:
    """The pose (4,4) of a scan in the frame of the file; identity where it has none."""
    pose = np.eye(4)
    if header.has_pose():
        pose[:3, :3] = np.asarray(header.rotation_matrix, dtype=np.float64)
        pose[:3, 3] = np.asarray(header.translation, dtype=np.float64)
    return pose


def is_range_image(raw: dict[str, Any]) -> bool:
    """Whether the points have rows and columns, of which there are several each."""
    return all(name in raw and np.ptp(raw[name]) > 0 for name in ("rowIndex", "columnIndex"))


def read_scan(header: Any, raw: dict[str, Any], index: int) -> tuple[Floats, Floats | None, Bytes | None]:
    """Points (N,3) in the frame of the file, normals (N,3) and colours (N,3), without points marked as invalid."""
    if "cartesianX" in raw:
        points = np.column_stack([raw[f"cartesian{axis}"] for axis in "XYZ"]).astype(np.float64)
        state = raw.get("cartesianInvalidState")
    elif "sphericalRange" in raw:
        reach, azimuth, elevation = (
            np.asarray(raw[f"spherical{name}"], dtype=np.float64) for name in ("Range", "Azimuth", "Elevation")
        )
        flat = reach * np.cos(elevation)
        points = np.column_stack([flat * np.cos(azimuth), flat * np.sin(azimuth), reach * np.sin(elevation)])
        state = raw.get("sphericalInvalidState")
    else:
        raise FormatError(f"scan {index + 1} of the E57 file has neither Cartesian nor spherical coordinates")
    names = [f"nor:normal{axis}" for axis in "XYZ"]
    normals = np.column_stack([raw[n] for n in names]).astype(np.float64) if all(n in raw for n in names) else None
    colours = _read_colours(header, raw)
    if state is not None:
        valid = np.asarray(state) == 0
        points = points[valid]
        normals = None if normals is None else normals[valid]
        colours = None if colours is None else colours[valid]
    if header.has_pose():
        pose = read_pose(header)
        R = pose[:3, :3]
        points = points @ R.T + pose[:3, 3]
        normals = None if normals is None else normals @ R.T
    return points, normals, colours


def _read_colours(header: Any, raw: dict[str, Any]) -> Bytes | None:
    """Colours (N,3) on the scale that the scan's colour limits give; without limits, by their values."""
    names = [f"color{name}" for name in ("Red", "Green", "Blue")]
    if not all(name in raw for name in names):
        return None
    try:
        largest = max(float(header["colorLimits"][f"{name}Maximum"].value()) for name in names)
    except Exception:  # of the library, where there are no limits, or others
        largest = None
    values = np.column_stack([raw[name] for name in names])
    return scale_colours(values, largest if largest and np.isfinite(largest) and largest > 0 else None)
