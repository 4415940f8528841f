"""The surface that cuts a damage volume out of a part, beyond the damage volume."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import Solid, Surface
from damageest.geometry.bodies import split_bodies
from damageest.geometry.refinement import halve_edges
from damageest.geometry.skin import find_inner_faces
from damageest.geometry.solids import to_manifold, to_solid
from tests.needs import import_for, needs_plugin

pytestmark = needs_plugin("cadquery")
cq = import_for("cadquery", "cadquery")
TOLERANCE = 0.5


def test_the_cut_of_one_site_does_not_reach_that_of_another() -> None:
    """One enclosure cuts the ends off two legs 1 mm apart; of its surface, three rings of 1 mm about a site reach the
    other leg."""
    from damageest_cadquery.surfaces.open_surface import make_cut
    from test_cadquery_balance import mesh_part

    legs = cq.Workplane().box(40, 21, 10).cut(cq.Workplane().box(40, 1, 10).translate((10, 0, 0)))
    part = mesh_part(legs, 0.1)
    box = mesh_part(cq.Workplane().box(20, 41, 30).translate((20, 0, 0)), 0.1)
    fine = halve_edges(box, 1.0)
    enclosure = Solid(fine.vertices, fine.faces)
    origin = np.zeros(3)
    both = to_solid(to_manifold(part, origin) ^ to_manifold(enclosure, origin), origin)
    assert both is not None
    for damage in split_bodies(both):
        inner = find_inner_faces(damage, part)
        cut = make_cut(damage, Surface(damage.vertices, damage.faces[inner]), part, [enclosure], TOLERANCE)
        assert cut is not None
        inside = cut.mesh.vertices[cut.height < -1e-9]
        side = np.sign(damage.bounds.mean(axis=0)[1])
        assert len(inside) > 50
        assert (side * inside[:, 1] > 0.5).all(), "in its own leg alone"
        assert (cut.height >= 0).any()
