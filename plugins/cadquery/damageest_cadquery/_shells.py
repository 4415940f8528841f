"""A solid's bodies, each with its cavities, with fewer triangles where that moves their surface little."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from damageest.artefacts import Floats, Mesh, Solid
from damageest.solids import to_manifold, to_solid

_SAME_VOLUME = 1e-3
_SLIVERS = 2e-3
"""Share of the surface that may lie farther off: wafers and spikes without volume, as Booleans leave them, go."""


def bodies(solid: Solid) -> list[tuple[Solid, list[Solid]]]:
    """Each connected body as its outer skin, and its cavities as solids of their own."""
    size, faces = len(solid.vertices), solid.faces
    links = coo_array((np.ones(2 * len(faces)), np.concatenate([faces[:, :2], faces[:, 1:]]).T), shape=(size, size))
    label = connected_components(links, directed=False)[1][faces[:, 0]]
    outer: list[Solid] = []
    cavities: list[Solid] = []
    for number in np.unique(label):
        used, own = np.unique(faces[label == number], return_inverse=True)
        mesh = Mesh(solid.vertices[used], own.reshape(-1, 3))
        for found, turned in ((outer, mesh.faces), (cavities, mesh.faces[:, ::-1])):
            try:
                found.append(Solid(mesh.vertices, turned))
                break
            except ValueError:  # inside out, or flat: neither
                continue
    out: list[tuple[Solid, list[Solid]]] = [(body, []) for body in outer]
    for cavity in cavities:
        holding = [pair for pair in out if len(out) == 1 or _holds(pair[0], cavity)]
        if holding:
            min(holding, key=lambda pair: pair[0].volume)[1].append(cavity)
    return out


def _holds(body: Solid, cavity: Solid) -> bool:
    import igl

    return bool(igl.winding_number(body.vertices, np.array(body.faces), cavity.vertices[:1])[0] > 0.5)


def simplified(body: Solid, detail: float) -> Solid:
    """The body with the fewest triangles that keep its surface within ``detail``, measured, and its volume."""
    area = np.linalg.norm(body.cross, axis=1)
    origin = body.bounds.mean(0)
    for share in (0.5, 0.2, 0.05):
        try:
            less = to_solid(to_manifold(body, origin).simplify(share * detail), origin)
        except ValueError:
            return body
        if less is None or len(less.faces) >= len(body.faces):
            continue
        lost = area[(_off(body, less) > detail)[body.faces].any(axis=1)].sum() / area.sum()
        same = abs(less.volume / body.volume - 1) <= _SAME_VOLUME
        if same and lost <= _SLIVERS and _off(less, body).max() <= detail:
            return less
    return body


def _off(one: Mesh, two: Mesh) -> Floats:
    """(V,) distances of the vertices of one to the surface of two."""
    import igl

    return np.asarray(np.sqrt(igl.point_mesh_squared_distance(one.vertices, two.vertices, np.array(two.faces))[0]))
