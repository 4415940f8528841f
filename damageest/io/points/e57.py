"""E57 (ASTM E2807), read by pye57: lengths in metres, any number of scans, each with its pose."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from damageest.artefacts import Floats
from damageest.io.points import FormatError, PointFile


def read(path: Path, columns: str | None = None) -> PointFile:
    """The points of all scans in the common frame of the file, without those that are marked as invalid."""
    import pye57

    with path.open("rb") as stream:
        if stream.read(8) != b"ASTM-E57":
            raise FormatError("not an E57 file: it does not start with 'ASTM-E57'")
    pieces: list[Floats] = []
    normals: list[Floats | None] = []
    with pye57.E57(str(path)) as file:
        for index in range(file.scan_count):
            points, normal = _read_scan(file, index)
            pieces.append(points)
            normals.append(normal)
    if not pieces:
        raise FormatError("the E57 file has no scans")
    whole = [n for n in normals if n is not None]
    notes = (f"{len(pieces)} scans in one E57 file",) if len(pieces) > 1 else ()
    return PointFile(
        np.concatenate(pieces), np.concatenate(whole) if len(whole) == len(normals) else None, unit="m", notes=notes
    )


def _read_scan(file: Any, index: int) -> tuple[Floats, Floats | None]:
    header = file.get_header(index)
    raw = file.read_scan_raw(index)
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
    if state is not None:
        valid = np.asarray(state) == 0
        points = points[valid]
        normals = None if normals is None else normals[valid]
    if header.has_pose():
        R = np.asarray(header.rotation_matrix, dtype=np.float64)
        points = points @ R.T + np.asarray(header.translation, dtype=np.float64)
        normals = None if normals is None else normals @ R.T
    return points, normals
