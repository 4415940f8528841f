"""Reads a scan that tells inside from outside: by its triangles, its normals or its scanner positions."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from damageest.artefacts import Mesh, Scan, Vector
from damageest.errors import InputError
from damageest.geometry.units import canonical_unit, unit_factor
from damageest.io.meshes import read_mesh
from damageest.io.scans import make_scan, read_scan
from damageest.io.triangles import MESH_SUFFIXES


def read_oriented(paths: tuple[Path, ...], unit: str, source: str | None, viewpoint: Vector | None = None) -> Scan:
    """The scan in files, in ``unit``, with normals where they can be known: those of the file, else toward the scanner,
    else by the triangles of a mesh. None where nothing tells them. Raises InputError where it cannot be read."""
    scan = read_scan(paths, unit, source, viewpoints=None if viewpoint is None else [viewpoint])
    if scan.normals is not None:
        return scan
    if scan.viewpoints is not None and scan.view is not None and (scan.view >= 0).all():
        return replace(scan, normals=scan.viewpoints[scan.view] - scan.points)
    if len(paths) == 1 and paths[0].suffix.lower() in MESH_SUFFIXES:
        try:
            return _read_mesh(paths[0], unit, source)
        except InputError:  # a file of points alone
            return scan
    return scan


def _read_mesh(path: Path, unit: str, source: str | None) -> Scan:
    """The vertices of a mesh with the normals of its triangles."""
    import trimesh

    vertices, faces, own = read_mesh(path)
    source = source or (canonical_unit(own) if own else unit)
    mesh = trimesh.Trimesh(vertices * unit_factor(source, unit), faces, process=False)
    mesh.merge_vertices()
    normals = Mesh(np.asarray(mesh.vertices), np.asarray(mesh.faces)).vertex_normals
    used = np.linalg.norm(normals, axis=1) > 0.5
    return make_scan(np.asarray(mesh.vertices)[used], normals[used], unit, paths=(str(path),))
