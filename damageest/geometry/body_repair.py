"""The bodies of a mesh: which triangles belong to one body, which way they face, and the union of overlapping bodies.

The steps of `damageest.geometry.healing.heal`, also useful alone. Coordinates may be in any unit and frame.
"""

from __future__ import annotations

import numpy as np

from damageest.artefacts import Flags, Floats, Ints, open_edges
from damageest.errors import InputError
from damageest.geometry.bodies import label_pieces
from damageest.geometry.shells import Shells, drop_unused_vertices, label_components, to_body
from damageest.geometry.slivers import find_slivers
from damageest.geometry.solids import to_arrays


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


def label_bodies(faces: Ints) -> tuple[Ints, int]:
    """The body (F,) of each of the faces (F,3), numbered from 0, and the number of bodies.

    Two triangles belong to one body if they are connected over edges that exactly two triangles share.
    """
    a, b, _ = _pair_neighbours(faces)
    return label_components(a, b, len(faces))


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
    label, _ = label_components(
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


def split_pinches(vertices: Floats, faces: Ints, notes: list[str]) -> tuple[Floats, Ints]:
    """The mesh (V,3), (F,3) with vertices of its own for each sheet where an even number of triangles, four or more,
    meet at an edge, for example of two cubes that touch along it.

    ``notes`` gets a line where this was done. A mesh that is closed already, or that cannot be closed so, is given back
    as it is.
    """
    if not open_edges(faces):
        return vertices, faces
    import manifold3d as m3

    body = to_body(vertices, faces)
    if body.status() != m3.Error.NoError or body.is_empty():
        return vertices, faces
    new_vertices, new_faces = to_arrays(body)
    if open_edges(new_faces):
        return vertices, faces
    notes.append("doubled the vertices of edges where more than two triangles meet")
    return new_vertices, new_faces


def resolve_bodies(
    vertices: Floats, faces: Ints, notes: list[str], gap: float = 0.0, outward: bool = False
) -> tuple[Floats, Ints]:
    """A mesh (V,3), (F,3) of the same bodies with faces outward, cavities inward and overlapping bodies united.

    The mesh given must be closed, with consistent windings in each body. The position of a shell decides which way it
    faces, not its windings: shells in no other one are bodies, those in a body are its cavities, those in a cavity
    bodies again. Bodies without volume are dropped. ``notes`` gets a line for each change, and one on separate bodies
    and cavities that are kept. ``gap``: how far the triangles may lie off the surface that they stand for: a union
    leaves no cavities that are thinner. ``outward``: the windings are those of a CAD kernel, where a shell in a body
    that faces outward is a body of its own, which is united with the other.

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
    shells = Shells(vertices, faces, label, volumes > 0)
    shells.relate(outward)
    _note_turned(shells, notes)
    if shells.are_apart:
        wrong = shells.faces_out != shells.should_face_out
        cavities = int((~shells.should_face_out).sum())
        if count - cavities > 1:
            notes.append(f"{count - cavities} separate bodies, kept as one part")
        if cavities:
            notes.append(f"{cavities} inner cavit{'ies' if cavities > 1 else 'y'}, kept")
        return drop_unused_vertices(vertices, _reverse_faces(faces, wrong[label]) if wrong.any() else faces)
    new_vertices, new_faces = shells.unite()
    notes.append(f"united {count} bodies that overlap, touch or lie in one another into one part")
    slivers = find_slivers(new_vertices, new_faces, gap)
    if slivers.all():
        raise InputError("encloses no volume: all its bodies are flat; a part must be a solid")
    if slivers.any():
        dropped = len(np.unique(label_pieces(new_faces)[slivers]))
        notes.append(f"dropped {dropped} slivers between them, thinner than their triangles are exact")
        new_vertices, new_faces = drop_unused_vertices(new_vertices, new_faces[~slivers])
    return new_vertices, new_faces


def _note_turned(shells: Shells, notes: list[str]) -> None:
    """A line on shells whose faces are turned."""
    wrong, top = shells.faces_out != shells.should_face_out, shells.should_face_out
    count = len(wrong)
    if wrong.all():
        notes.append("reversed all triangles: they faced inward")
    elif (wrong & top).any():
        notes.append(f"reversed the triangles of {int((wrong & top).sum())} of {count} bodies: they faced inward")
    if not wrong.all() and (turned := int((wrong & ~top).sum())):
        notes.append(
            f"reversed the triangles of {turned} shell{'s' * (turned > 1)} inside a body, which faced outward as a "
            f"body does: {'they count as cavities' if turned > 1 else 'it counts as a cavity'}"
        )


def _reverse_faces(faces: Ints, which: Flags) -> Ints:
    """The faces with the winding of some of them reversed."""
    faces = faces.copy()
    faces[which] = faces[which][:, ::-1]
    return faces
