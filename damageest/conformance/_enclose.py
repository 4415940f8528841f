"""The checks for stage `enclose`: site by site, and all sites at once."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, ClassVar

import numpy as np
import pytest

from damageest.artefacts import DAMAGE, INTACT, Deviation, Enclosures, Floats, Mesh, Rims, Sites, Solid, Surface
from damageest.conformance import _scene
from damageest.conformance._base import PlacedContract, back, right_or_refused
from damageest.geometry.distance import distance_to_mesh, is_inside
from damageest.geometry.solids import iou, to_manifold, to_solid, unite


class EncloseContract(PlacedContract):
    """Checks for `enclose`, site by site, on a round dent in a flat face and on a bore worn through.

    ``repair``: the implementation of `repair` that it relies on, where it does not give a closed mesh by itself.
    ``error``: share of the true volume by which what it finds may be off.
    """

    repair: ClassVar[Any] = None
    error: ClassVar[float] = 0.03

    def solid(self, enclosure: Mesh, tolerance: float = _scene.TOLERANCE) -> Solid:
        """The enclosure made watertight, as the route does it."""
        if self.repair is None:
            return Solid(enclosure.vertices, enclosure.faces)
        given = {"enclosure": enclosure, "tolerance": tolerance}
        made = self.repair.run(**{name: given[name] for name in self.repair.needs()})
        assert isinstance(made, Solid)
        return made

    def lost(self, enclosure: Mesh) -> Solid:
        """What of the plain scene's part lies in an enclosure."""
        lost = to_solid(to_manifold(self.solid(enclosure)) ^ to_manifold(_scene.prism()))
        assert lost is not None, "the enclosure holds nothing of the part"
        return lost

    def right(self, enclosure: Mesh) -> None:
        """Holds the dent, and of the part nothing else."""
        true = _scene.dent(0)
        lost = self.lost(enclosure)
        assert lost.volume == pytest.approx(true.volume, rel=self.error)
        assert iou(lost, true) > 1 - 2 * self.error
        assert not _deep(_scene.scene().intact, enclosure), "it holds sound points"

    def test_holds_the_damage_and_no_sound_points(self) -> None:
        self.right(self.plain())

    def test_which_way_the_surface_is_wound_does_not_matter(self) -> None:
        surface, rims = _scene.bowl(), _scene.scene().rims
        turned = Surface(surface.vertices, surface.faces[:, ::-1])
        self.right(self.run(surface=turned, rims=Rims(tuple(loop[::-1] for loop in rims.loops))))

    def test_worn_through_is_right_or_refused(self) -> None:
        bore, count = _scene.bore(), _scene.SECTIONS
        first, last = np.arange(count), np.arange(len(bore.vertices) - count, len(bore.vertices))[::-1]
        points = _scene.prism()
        skin, _ = _scene.spread(points, 15_000, np.random.default_rng(3))
        skin = skin[np.hypot(*(skin[:, :2] - [-3, -1]).T) > _scene.BORE]
        wall, _ = _scene.spread(bore, 2500, np.random.default_rng(4))

        def right(enclosure: Mesh) -> None:
            true = np.pi * _scene.BORE**2 * 2 * _scene.HALF_HEIGHT
            assert self.lost(enclosure).volume == pytest.approx(true, rel=self.error)
            assert not _deep(skin, enclosure)

        right_or_refused(lambda: self.run(surface=bore, rims=Rims((first, last)), intact=skin, points=wall), right)

    def test_no_sound_points_to_tell_the_sides_by(self) -> None:
        right_or_refused(lambda: self.run(intact=np.empty((0, 3))), self.right)

    def test_no_rim(self) -> None:
        right_or_refused(lambda: self.run(rims=Rims(())), self.right)

    def test_an_empty_surface(self) -> None:
        empty = Surface(np.empty((0, 3)), np.empty((0, 3), int))
        right_or_refused(lambda: self.run(surface=empty, rims=Rims(())), self.right)

    def test_a_background_elsewhere(self) -> None:
        elsewhere = _scene.box_round(np.array([40.0, 40, 40]), np.array([50.0, 50, 50]), 3 * _scene.TOLERANCE)
        right_or_refused(lambda: self.run(background=elsewhere), self.right)

    def agree(self, got: Any, plain: Any, scale: float, turn: Floats, shift: Floats) -> None:
        placed = self.solid(got, scale * _scene.TOLERANCE)
        self.right(Mesh(back(placed.vertices, scale, turn, shift), placed.faces))


class EncloseAllContract(PlacedContract):
    """Checks for `enclose`, all sites at once, on two round dents on two faces.

    ``error``: share of the true volume by which what it finds may be off.
    """

    error: ClassVar[float] = 0.03

    def right(self, enclosures: Enclosures) -> None:
        """Covers every site once, and holds the dents and of the part nothing else."""
        part, truth = to_manifold(_scene.prism()), unite(_scene.dent(k) for k in (0, 1))
        assert sorted(k for item in enclosures.items for k in item.sites) == [1, 2]
        lost = unite(item.solid for item in enclosures.items) ^ part
        assert lost.volume() == pytest.approx(truth.volume(), rel=self.error)
        assert iou(to_solid(lost), to_solid(truth)) > 1 - 2 * self.error
        apart = sum((to_manifold(item.solid) ^ part).volume() for item in enclosures.items)
        assert apart == pytest.approx(lost.volume(), rel=1e-6), "enclosures overlap in the part"
        for item in enclosures.items:
            assert not _deep(_scene.scene().intact, item.solid), "it holds sound points"

    def test_holds_the_damage_and_no_sound_points(self) -> None:
        self.right(self.plain())

    def test_each_site_is_in_the_enclosure_that_says_so(self) -> None:
        scene = _scene.scene()
        for item in self.plain().items:
            near = scene.aligned.points[np.isin(scene.sites.label, item.sites)]
            low, high = item.solid.bounds
            assert ((near > low - _scene.TOLERANCE) & (near < high + _scene.TOLERANCE)).all()

    @pytest.mark.parametrize("kept", ["no sound points", "few points"])
    def test_a_scan_that_says_little(self, kept: str) -> None:
        scene = _scene.scene()
        chosen = np.flatnonzero(scene.sites.label) if kept == "no sound points" else np.arange(30)
        of = scene.deviation
        few = {
            "aligned": replace(scene.aligned, points=scene.aligned.points[chosen], normals=None),
            "deviation": Deviation(of.distance[chosen], of.face[chosen], of.label[chosen]),
            "sites": Sites(scene.sites.label[chosen], 2),
        }

        def right(enclosures: Enclosures) -> None:
            assert {k for item in enclosures.items for k in item.sites} <= {1, 2}

        right_or_refused(lambda: self.run(**few), right)

    def test_no_sites_no_enclosures(self) -> None:
        scene = _scene.scene()
        none = Sites(np.zeros(len(scene.aligned.points), np.int32), 0)
        distance = np.where(scene.deviation.label == DAMAGE, 0, scene.deviation.distance)
        sound = Deviation(distance, scene.deviation.face, np.full(len(distance), INTACT, np.uint8))
        got = self.run(sites=none, deviation=sound)
        assert isinstance(got, Enclosures)
        assert not got.items

    def agree(self, got: Any, plain: Any, scale: float, turn: Floats, shift: Floats) -> None:
        def there(item: Any) -> Any:
            return type(item)(Solid(back(item.solid.vertices, scale, turn, shift), item.solid.faces), item.sites)

        self.right(Enclosures(tuple(there(item) for item in got.items)))


def _deep(points: Floats, mesh: Mesh) -> int:
    """How many points (N,3) lie inside a mesh by more than the tolerance."""
    near = points[((points > mesh.bounds[0]) & (points < mesh.bounds[1])).all(axis=1)]
    if not len(near):
        return 0
    far = distance_to_mesh(near, mesh)
    return int((is_inside(near, mesh) & (far > _scene.TOLERANCE)).sum())
