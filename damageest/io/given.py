"""Parts and scans that a caller in Python has already: of numpy, trimesh, PyVista, Open3D, or damageest's own."""

from __future__ import annotations

from typing import Any

import numpy as np

from damageest.artefacts import Floats, Part, Scan
from damageest.errors import InputError
from damageest.geometry.make_part import make_part

PARTS = (
    "a damageest Part, a trimesh.Trimesh or Scene, a pyvista.PolyData with faces, an Open3D TriangleMesh, or "
    "(vertices, faces) as arrays (V,3) and (F,3)"
)
SCANS = (
    "a damageest Scan, an array (N,3), a trimesh mesh, PointCloud or Scene, a pyvista.PolyData or PointSet, or an "
    "Open3D PointCloud or TriangleMesh"
)


def as_part(value: Any, units: str) -> Part:
    """A part from an object of the caller, lengths in ``units``. Raises InputError for an object that is none of
    `PARTS`."""
    if isinstance(value, Part):
        return value
    try:
        vertices, faces = _take_mesh(value)
    except (TypeError, ValueError) as error:
        raise InputError(f"part: {_describe(value)} cannot be used ({error}); give {PARTS}") from None
    return make_part(vertices, faces, unit=units)


def as_scan(value: Any, units: str) -> Scan:
    """A scan from an object of the caller, lengths in ``units``. Raises InputError for an object that is none of
    `SCANS`."""
    if isinstance(value, Scan):
        return value
    try:
        points, normals = _take_points(value)
    except (TypeError, ValueError) as error:
        raise InputError(f"scan: {_describe(value)} cannot be used ({error}); give {SCANS}") from None
    if points.ndim != 2 or points.shape[1] != 3 or not len(points):
        raise InputError(f"scan: give points of shape (N,3), N > 0; not {points.shape}")
    if not np.isfinite(points).all():
        raise InputError(f"scan: {int((~np.isfinite(points).all(1)).sum())} of its points are not finite; remove them")
    return Scan(points, normals=normals, unit=units)


def _take_mesh(value: Any) -> tuple[Floats, Any]:
    """Vertices (V,3) and faces (F,3). Raises ValueError or TypeError where there are none."""
    kind = _name_kind(value)
    if kind.startswith("pyvista."):
        if not hasattr(value, "regular_faces"):
            raise ValueError("only a PolyData has faces; take its extract_surface()")
        surface = value.triangulate()
        if not surface.n_cells:
            raise ValueError("it has no faces")
        return np.array(surface.points, float), np.asarray(surface.regular_faces, np.int64)
    if kind.startswith("open3d."):
        value = _take_legacy(value)
        if not hasattr(value, "triangles"):
            raise ValueError("it has no triangles")
        return np.array(value.vertices, float), np.array(value.triangles, np.int64)
    value = _join_scene(value, "faces")
    if hasattr(value, "vertices") and hasattr(value, "faces"):
        value = (value.vertices, value.faces)
    if not (isinstance(value, (tuple, list)) and len(value) == 2):
        raise TypeError("it has no vertices and faces")
    vertices, faces = _take_numbers(value[0]), np.asarray(value[1])
    if not np.issubdtype(faces.dtype, np.integer):
        raise TypeError("its faces are no numbers of vertices")
    return vertices, faces.astype(np.int64)


def _take_points(value: Any) -> tuple[Floats, Floats | None]:
    """Points (N,3), and normals (N,3) where a point cloud has them."""
    kind = _name_kind(value)
    if kind.startswith("open3d."):
        value = _take_legacy(value)
        normals = value.normals if hasattr(value, "has_normals") and value.has_normals() else None
        points = np.array(value.points if hasattr(value, "points") else value.vertices, float)
        return points, None if normals is None else np.array(normals, float)
    if kind.startswith("pyvista."):
        return np.array(value.points, float), None
    if isinstance(value, (str, bytes, dict)):
        raise TypeError("it holds no points")
    value = _join_scene(value, "vertices")
    return _take_numbers(getattr(value, "vertices", value)), None


def _take_legacy(value: Any) -> Any:
    """What Open3D holds as tensors, in its classes without them, which have the same fields for all versions."""
    return value.to_legacy() if hasattr(value, "to_legacy") else value


def _join_scene(value: Any, field: str) -> Any:
    """The meshes, or point clouds, of a scene of trimesh as one, each where the scene places it: `trimesh.load` gives
    scenes. ``field``: what they must have."""
    if not _name_kind(value).startswith("trimesh.") or not hasattr(value, "graph"):
        return value
    import trimesh

    placed = [each for each in value.dump() if hasattr(each, field) and len(getattr(each, field))]
    if not placed:
        raise ValueError(f"nothing in it has {field}")
    if field == "faces" and len(placed) > 1:
        return trimesh.util.concatenate(placed)
    return placed[0] if len(placed) == 1 else np.vstack([each.vertices for each in placed])


def _take_numbers(value: Any) -> Floats:
    """Real numbers; what a masked array hides is not a number."""
    if isinstance(value, np.ma.MaskedArray):
        value = np.ma.filled(value.astype(float), np.nan)
    found = np.asarray(value)
    if np.iscomplexobj(found):
        raise TypeError("its numbers are complex")
    return np.asarray(found, dtype=float)


def _name_kind(value: Any) -> str:
    return f"{type(value).__module__}.{type(value).__qualname__}"


def _describe(value: Any) -> str:
    shape = getattr(value, "shape", None)
    return f"a {_name_kind(value).removeprefix('builtins.')}" + (f" of shape {shape}" if shape is not None else "")
