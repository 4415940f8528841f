"""Builds OpenCASCADE solids with planar faces from meshes. Lengths in millimetres."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from damageest.artefacts import Floats, Solid
from damageest.geometry.bodies import split_shells
from damageest.geometry.body_repair import label_bodies
from damageest_cadquery.solids.facets import FLAT, Facet, find_facets, take_triangles, weld

Shell = tuple[Floats, list[Facet]]
"""Corners (V,3) and the faces between them."""
Shells = list[list[Shell]]
"""The shells of each body, the outer one first."""


def split_solids(solid: Solid) -> list[tuple[Solid, list[Solid]]]:
    """The bodies of a solid with their cavities. Those that touch in points alone are bodies of their own, as
    OpenCASCADE reads them."""
    label, count = label_bodies(solid.faces)
    if count > 1:
        size = len(solid.vertices)
        used, faces = np.unique(label[:, None] * size + solid.faces, return_inverse=True)
        solid = Solid(solid.vertices[used % size], faces.reshape(-1, 3))
    return split_shells(solid)


def find_shells(solid: Solid, joined: bool = True) -> Shells:
    """The shells of a solid's bodies; ``joined``: triangles in one plane are one face."""
    bodies = [[weld(each) for each in (outer, *cavities)] for outer, cavities in split_solids(solid)]
    find = find_facets if joined else take_triangles
    return [[(shell.vertices, find(shell)) for shell in body] for body in bodies]


def count_faces(shells: Shells) -> int:
    """How many faces they have."""
    return sum(len(faces) for body in shells for _, faces in body)


def build_solid(solid: Solid) -> tuple[Any, int]:
    """An OpenCASCADE solid with planar faces, or a compound of several, and its number of faces. In millimetres."""
    shells = find_shells(solid)
    return build_shape(shells, 1.0), count_faces(shells)


def build_shape(parts: Shells, scale: float) -> Any:
    """A solid, or a compound of several; the first shell of each is the outer one."""
    from OCP.BRep import BRep_Builder
    from OCP.TopoDS import TopoDS_Compound, TopoDS_Solid

    builder = BRep_Builder()
    made = []
    for part in parts:
        solid = TopoDS_Solid()
        builder.MakeSolid(solid)
        for number, (vertices, planar) in enumerate(part):
            shell = build_shell(vertices * scale, planar)
            builder.Add(solid, shell if number == 0 else shell.Reversed())
        made.append(solid)
    if len(made) == 1:
        return made[0]
    compound = TopoDS_Compound()
    builder.MakeCompound(compound)
    for solid in made:
        builder.Add(compound, solid)
    return compound


def build_shell(vertices: Floats, planar: Sequence[Facet], closed: bool = True) -> Any:
    """A shell whose faces share their edges, and its edges their corners. Lengths in millimetres."""
    from OCP.BRep import BRep_Builder
    from OCP.Geom import Geom_Line, Geom_Plane
    from OCP.gp import gp_Dir, gp_Pnt
    from OCP.TopAbs import TopAbs_REVERSED
    from OCP.TopoDS import TopoDS_Edge, TopoDS_Face, TopoDS_Shell, TopoDS_Vertex, TopoDS_Wire

    builder = BRep_Builder()
    close = max(1e-7, 4 * FLAT * float(np.linalg.norm(np.ptp(vertices, axis=0))))
    places = vertices.tolist()
    corners: dict[int, Any] = {}
    edges: dict[tuple[int, int], Any] = {}

    def corner(index: int) -> Any:
        if index not in corners:
            corners[index] = TopoDS_Vertex()
            builder.MakeVertex(corners[index], gp_Pnt(*places[index]), close)
        return corners[index]

    def edge(start: int, end: int) -> Any:
        key = (min(start, end), max(start, end))
        if key not in edges:
            (x, y, z), (u, v, w) = places[key[0]], places[key[1]]
            made, length = TopoDS_Edge(), math.dist(places[key[0]], places[key[1]])
            line = Geom_Line(gp_Pnt(x, y, z), gp_Dir(u - x, v - y, w - z))
            builder.MakeEdge(made, line, close)
            builder.Add(made, corner(key[0]))
            builder.Add(made, corner(key[1]).Oriented(TopAbs_REVERSED))
            builder.Range(made, 0.0, length)
            edges[key] = made
        return edges[key] if start < end else edges[key].Reversed()

    shell = TopoDS_Shell()
    builder.MakeShell(shell)
    for facet in planar:
        face = TopoDS_Face()
        loops = [loop.tolist() for loop in facet.loops]
        corners_here = [places[index] for index in loops[0]]
        at = (sum(values) / len(corners_here) for values in zip(*corners_here, strict=True))
        builder.MakeFace(face, Geom_Plane(gp_Pnt(*at), gp_Dir(*facet.normal.tolist())), close)
        for indices in loops:
            wire = TopoDS_Wire()
            builder.MakeWire(wire)
            for start, end in zip(indices, indices[1:] + indices[:1], strict=True):
                if places[start] != places[end]:  # no length, no direction
                    builder.Add(wire, edge(start, end))
            wire.Closed(True)
            builder.Add(face, wire)
        builder.Add(shell, face)
    shell.Closed(closed)
    return shell
