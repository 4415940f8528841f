"""References for exact damage volumes and deposits that are fairer than the run's mesh.

The mesh ends on the part's triangles, whose chords cut off metal of curved faces or add to it, and it rounds the rim of
the damage, on which its stock stands. So an exact damage volume is also compared without what these chords do, and with
the true damage; and an exact deposit with the stock that the stage `allowance: milling` builds of triangles on the
exact damage volume's own skin.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from damageest.artefacts import Mesh, Part, Solid
from damageest.errors import describe_error

FINE = 1 / 128
"""Chord of the triangles that stand for CAD faces, in tolerances."""


class Cad:
    """The CAD solids of a part near a damage, as fine triangles, beside the part's own triangles."""

    def __init__(self, solids: Sequence[Any], part: Part, near: Solid, tolerance: float) -> None:
        from damageest_cadquery.shapes import is_near, triangulate

        from damageest.geometry.solids import to_manifold

        self.tolerance, self.part = tolerance, part
        self.origin = near.bounds.mean(axis=0)
        self.meshed = to_manifold(part, self.origin)
        fine = [to_manifold(triangulate(each, FINE * tolerance), self.origin) for each in solids if is_near(each, near)]
        self.fine = add(fine)

    def measure_damage(self, exact: Mesh, mesh: Mesh, truth: Mesh | None) -> dict[str, Any]:
        """For an exact damage volume: by how much it is larger than ``mesh`` because of chords alone; and how near
        both are to the true damage, as intersection over union."""
        from manifold3d import Manifold

        from damageest.geometry.solids import iou, to_manifold, to_solid

        first, second = to_manifold(exact, self.origin), to_manifold(mesh, self.origin)
        row = {"fine": first.volume(), "chords": (first - self.meshed).volume() - (second - self.fine).volume()}
        size = mesh.bounds[1] - mesh.bounds[0] + 8 * self.tolerance
        near = None
        if truth is not None:
            near = to_solid(to_manifold(truth, self.origin) ^ Manifold.cube(tuple(size.tolist()), True), self.origin)
        if near is None:
            return row
        # the truth ends on the part's triangles
        own = to_solid(first ^ self.meshed, self.origin)
        return row | {"truth": near.volume, "iou_mesh": iou(near, mesh), "iou_exact": iou(near, own)}

    def build_deposit(self, damage: Part, height: float) -> float:
        """The volume of an exact damage volume, as triangles with names, and stock of the stage on its own skin."""
        from damageest.geometry.solids import to_manifold
        from damageest.stages.allowance.plain_stock import build_plain_stock

        outer = np.array([" inner " not in name for name in damage.face_names])[damage.faces_brep]
        skin = Mesh(damage.vertices, damage.faces[outer])
        heights = np.full(len(skin.faces), height)
        stock = build_plain_stock(skin, heights, self.origin, self.tolerance)
        hole = to_manifold(damage, self.origin)
        rest = (stock ^ (self.fine - hole)).decompose()
        metal = [each for each in rest if 2 * each.volume() > 2 * FINE * self.tolerance * each.surface_area()]
        return float((add([hole, stock]) - add(metal)).volume())


def add(solids: Sequence[Any]) -> Any:
    """The union of Manifolds."""
    from manifold3d import Manifold, OpType

    return Manifold.batch_boolean(list(solids), OpType.Add) if solids else Manifold()


def read_triangles(path: Path, tolerance: float) -> Part:
    """A written file as fine triangles, with the names of its faces."""
    from damageest_cadquery.brep import Brep

    return Brep(path=path, chord=FINE * tolerance).run(unit="mm", tolerance=None)


def measure_fairly(
    site: dict[str, Any],
    solids: Sequence[Any],
    part: Part,
    mesh: Solid,
    truth: Mesh | None,
    place: Path,
    tolerance: float,
    height: float,
) -> None:
    """Adds to the row of a ``site`` how its exact damage volume and deposit compare with these references; or why
    they do not."""  # fmt: skip
    try:
        exact = read_triangles(place / f"damage/site-{site['site']}.step", tolerance)
        cad = Cad(solids, part, mesh, tolerance)
        site["damage"] |= cad.measure_damage(exact, mesh, truth)
        if "deposit" in site:
            site["deposit"]["on_own_skin"] = cad.build_deposit(exact, height)
    except Exception as error:  # OpenCASCADE's exceptions share no base of their own
        site["unfair"] = describe_error(error, 200)
