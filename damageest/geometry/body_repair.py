"""The bodies of a mesh: which triangles belong to one body, which way they face, and the union of overlapping bodies.

The steps of `damageest.geometry.healing.heal`, also useful alone. Coordinates may be in any unit and frame.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from damageest.artefacts import Floats, Ints, open_edges
from damageest.errors import InputError
from damageest.geometry.bodies import label_pieces
from damageest.geometry.duplicates import list_used
from damageest.geometry.slivers import find_slivers

_MOST_PAIRS = 5000
"""Pairs of bodies with overlapping bounds up to which each pair is compared; above it all bodies are united at once."""


def _pair_neighbours(faces: Ints) -> tuple[Ints, Ints, Ints]:
    """Pairs of triangles (P,), (P,) over edges that exactly two share, and whether their windings disagree (P,), 0 or
    1."""
    if not len(faces):
        return faces[:, 0], faces[:, 0], faces[:, 0]
    directed = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    owner = np.tile(np.arange(len(faces)), 3)
    low, high = directed.min(1), directed.max(1)
    code = low * (int(faces.max()) + 1) + high
    order = np.argsort(code, kind="stable")
    code, owner, forward = code[order], owner[order], (directed[:, 0] == low)[order]
    starts = np.flatnonzero(np.concatenate([[True], code[1:] != code[:-1]]))
    runs = np.diff(np.concatenate([starts, [len(code)]]))
    two = starts[runs == 2]
    return owner[two], owner[two + 1], (forward[two] == forward[two + 1]).astype(np.int64)


def _label_components(a: Ints, b: Ints, count: int) -> tuple[Ints, int]:
    """Component (count,) of each of ``count`` nodes under the links from ``a`` to ``b``, and how many there are."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    bodies, label = connected_components(
        coo_matrix((np.ones(len(a), bool), (a, b)), shape=(count, count)), directed=False
    )
    return label.astype(np.int64), int(bodies)


def label_bodies(faces: Ints) -> tuple[Ints, int]:
    """The body (F,) of each of the faces (F,3), numbered from 0, and the number of bodies.

    Two triangles belong to one body if they are connected over edges that exactly two triangles share.
    """
    a, b, _ = _pair_neighbours(faces)
    return _label_components(a, b, len(faces))


def orient_faces(faces: Ints) -> tuple[Ints, int | None]:
    """The faces (F,3) with consistent windings, and how many were reversed; the faces as they are, and None, where the
    surface is one-sided (like a Moebius strip).

    In each body the smaller number of triangles is reversed. Whether the faces then point outward is not decided here:
    see `resolve_bodies`.

    Each triangle has two nodes in a graph, one as read and one reversed. An edge of the mesh connects the nodes that
    agree over it. Each component of the graph then is one consistent choice.
    """
    if not len(faces):
        return faces, 0
    a, b, differ = _pair_neighbours(faces)
    n = len(faces)
    label, _ = _label_components(
        np.concatenate([a, a + n]), np.concatenate([b + n * differ, b + n * (1 - differ)]), 2 * n
    )
    as_read, turned = label[:n], label[n:]
    if (as_read == turned).any():
        return faces, None
    # the two components of a body mirror each other; the one that holds more triangles as read is taken
    kept = np.bincount(as_read, minlength=int(label.max()) + 1)
    flip = kept[as_read] < kept[turned]
    tie = kept[as_read] == kept[turned]
    flip |= tie & (as_read > turned)
    result = faces.copy()
    result[flip] = result[flip][:, ::-1]
    return result, int(flip.sum())


def signed_volumes(vertices: Floats, faces: Ints, label: Ints, count: int) -> Floats:
    """Volume (count,) of each closed body, negative where its triangles face inward.

    Args:
        vertices, faces: (V,3), (F,3) of all bodies.
        label: (F,) the body of each face, from 0 to ``count`` - 1, as `label_bodies` gives it.

    In the cube of the vertices' unit; by the divergence theorem about the centre of all vertices' bounds.
    """
    if not len(faces):
        return np.zeros(count)
    centre = (vertices.min(0) + vertices.max(0)) / 2
    a, b, c = np.moveaxis((vertices - centre)[faces], 1, 0)
    each = np.einsum("ij,ij->i", a, np.cross(b, c)) / 6
    return np.bincount(label, each, minlength=count).astype(np.float64)


def _to_manifold(vertices: Floats, faces: Ints) -> Any:
    """The mesh as a manifold3d body, whose status the caller checks; coordinates should be near the origin."""
    import manifold3d as m3

    # copies, because manifold3d rejects read-only arrays, as those of artefacts are
    return m3.Manifold(
        m3.Mesh64(np.array(vertices, dtype=np.float64, order="C"), np.array(faces, dtype=np.uint64, order="C"))
    )


def _to_arrays(body: Any) -> tuple[Floats, Ints]:
    """Vertices (V,3) and faces (F,3) of a manifold3d body."""
    mesh = body.to_mesh64()
    return np.asarray(mesh.vert_properties, dtype=np.float64)[:, :3], np.asarray(mesh.tri_verts).astype(np.int64)


def split_pinches(vertices: Floats, faces: Ints, notes: list[str]) -> tuple[Floats, Ints]:
    """The mesh (V,3), (F,3) with vertices of its own for each sheet where an even number of triangles, four or more,
    meet at an edge, as where two cubes touch along an edge.

    ``notes`` gets a line where this was done. A mesh that is closed already, or that cannot be closed so, is given back
    as it is.
    """
    if not open_edges(faces):
        return vertices, faces
    import manifold3d as m3

    body = _to_manifold(vertices, faces)
    if body.status() != m3.Error.NoError or body.is_empty():
        return vertices, faces
    new_vertices, new_faces = _to_arrays(body)
    if open_edges(new_faces):
        return vertices, faces
    notes.append("doubled the vertices of edges where more than two triangles meet")
    return new_vertices, new_faces


def resolve_bodies(vertices: Floats, faces: Ints, notes: list[str], gap: float = 0.0) -> tuple[Floats, Ints]:
    """A mesh (V,3), (F,3) of the same bodies with faces outward, cavities inward and overlapping bodies united.

    The mesh given must be closed, with consistent windings in each body. Bodies without volume are dropped. ``notes``
    gets a line for each change, and one on separate bodies and cavities that are kept. ``gap``: how far the triangles
    may lie off the surface that they stand for: a union leaves no cavities that are thinner.

    Raises InputError where no body has volume, or where bodies overlap but cannot be united.
    """
    if not len(faces):
        raise InputError("encloses no volume: it has no triangles; a part must be a solid")
    label, count = label_bodies(faces)
    volumes = signed_volumes(vertices, faces, label, count)
    size = float(np.prod(np.maximum(np.ptp(vertices, axis=0), 1e-300)))
    flat = np.abs(volumes) <= 1e-12 * size
    if flat.all():
        raise InputError("encloses no volume: all its bodies are flat; a part must be a solid")
    if flat.any():
        notes.append(f"dropped {int(flat.sum())} bodies without volume")
        faces = faces[~flat[label]]
        label, count = label_bodies(faces)
        volumes = signed_volumes(vertices, faces, label, count)
    depth, crossing = _find_nesting(vertices, faces, label, count)
    if not crossing:
        top = depth == 0
        if (volumes[top] < 0).all():
            faces, volumes = faces[:, ::-1], -volumes
            notes.append("reversed all triangles: they faced inward")
        wrong = top & (volumes < 0)
        if wrong.any():
            faces, volumes = _reverse_faces(faces, wrong[label]), np.abs(volumes) * np.where(wrong, 1, np.sign(volumes))
            notes.append(f"reversed the triangles of {int(wrong.sum())} of {count} bodies: they faced inward")
        if ((volumes > 0) == (depth % 2 == 0)).all():
            cavities = int((volumes < 0).sum())
            if count - cavities > 1:
                notes.append(f"{count - cavities} separate bodies, kept as one part")
            if cavities:
                notes.append(f"{cavities} inner cavit{'ies' if cavities > 1 else 'y'}, kept")
            return _drop_unused_vertices(vertices, faces)
    return _unite(vertices, faces, label, volumes, notes, gap)


def _reverse_faces(faces: Ints, which: Any) -> Ints:
    """The faces with the winding of some of them reversed."""
    faces = faces.copy()
    faces[which] = faces[which][:, ::-1]
    return faces


def _drop_unused_vertices(vertices: Floats, faces: Ints) -> tuple[Floats, Ints]:
    """The same mesh without vertices that no face uses."""
    used = list_used(faces)
    if len(used) == len(vertices):
        return vertices, faces
    index = np.zeros(len(vertices), np.int64)
    index[used] = np.arange(len(used))
    return vertices[used], index[faces]


def _find_nesting(vertices: Floats, faces: Ints, label: Ints, count: int) -> tuple[Ints, bool]:
    """In how many other bodies each body lies (count,), and whether any two cross or touch.

    Two bodies are disjoint if the volume of their union is the sum of their volumes, and nested if it is the larger of
    the two. A smaller surface area of the union shows that they touch.
    """
    depth = np.zeros(count, np.int64)
    if count == 1:
        return depth, False
    corners = vertices[faces]
    order = np.argsort(label, kind="stable")
    starts = np.searchsorted(label[order], np.arange(count))
    low = np.minimum.reduceat(corners.min(1)[order], starts)
    high = np.maximum.reduceat(corners.max(1)[order], starts)
    pairs = [
        (i, int(j))
        for i in range(count - 1)
        for j in i + 1 + np.flatnonzero(((low[i] <= high[i + 1 :]) & (low[i + 1 :] <= high[i])).all(1))
    ]
    if len(pairs) > _MOST_PAIRS:
        return depth, True
    origin = (vertices.min(0) + vertices.max(0)) / 2
    solids: dict[int, Any] = {}
    for i in {k for pair in pairs for k in pair}:
        v, f = _drop_unused_vertices(vertices - origin, faces[label == i])
        body = _to_manifold(v, f)
        solids[i] = body if body.volume() > 0 else _to_manifold(v, f[:, ::-1])
    for i, j in pairs:
        a, b = solids[i], solids[j]
        both = (a + b).volume()
        area = (a + b).surface_area()
        va, vb = a.volume(), b.volume()
        small = 1e-9 * (va + vb)
        if abs(both - va - vb) <= small:
            if area < (a.surface_area() + b.surface_area()) * (1 - 1e-9):
                return depth, True
        elif abs(both - max(va, vb)) <= small:
            if abs(area - (a if va > vb else b).surface_area()) > 1e-9 * area:
                return depth, True
            depth[i if va < vb else j] += 1
        else:
            return depth, True
    return depth, False


def _unite(
    vertices: Floats, faces: Ints, label: Ints, volumes: Floats, notes: list[str], gap: float
) -> tuple[Floats, Ints]:
    """The union of the bodies that face outward, minus the union of those that face inward. The faces of each body are
    those with its ``label`` (F,); ``volumes`` are signed."""
    import manifold3d as m3

    if (volumes < 0).all():
        faces, volumes = faces[:, ::-1], -volumes
        notes.append("reversed all triangles: they faced inward")
    origin = (vertices.min(0) + vertices.max(0)) / 2
    gathered: dict[bool, list[Any]] = {True: [], False: []}
    for i, volume in enumerate(volumes):
        mesh = faces[label == i]
        v, f = _drop_unused_vertices(vertices - origin, mesh if volume > 0 else mesh[:, ::-1])
        body = _to_manifold(v, f)
        if body.status() != m3.Error.NoError:
            raise InputError(
                f"{len(volumes)} of its bodies overlap, and one of them is not a solid ({body.status()}); "
                "unite them in the CAD system and export again"
            )
        gathered[bool(volume > 0)].append(body)
    result = m3.Manifold.batch_boolean(gathered[True], m3.OpType.Add)
    if gathered[False]:
        result -= m3.Manifold.batch_boolean(gathered[False], m3.OpType.Add)
    if result.status() != m3.Error.NoError or result.is_empty():
        raise InputError("its overlapping bodies could not be united; unite them in the CAD system and export again")
    new_vertices, new_faces = _to_arrays(result)
    notes.append(f"united {len(volumes)} bodies that overlap, touch or lie in one another into one part")
    slivers = find_slivers(new_vertices, new_faces, gap)
    if slivers.all():
        raise InputError("encloses no volume: all its bodies are flat; a part must be a solid")
    if slivers.any():
        count = len(np.unique(label_pieces(new_faces)[slivers]))
        notes.append(f"dropped {count} slivers between them, thinner than their triangles are exact")
        new_vertices, new_faces = _drop_unused_vertices(new_vertices, new_faces[~slivers])
    return new_vertices + origin, new_faces
