"""The checks for `sample`, `repair`, `boolean` and `allowance`, on a block of 4 x 3 x 2 with known volume."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np
import pytest

from damageest.artefacts import Deposit, Floats, Mesh, Part, Samples, Solid
from damageest.conformance import _scene
from damageest.conformance._base import REFUSED, PlacementContract, check_or_refused, undo_placement
from damageest.geometry.solids import to_manifold

SIZE = (4.0, 3.0, 2.0)


def make_block(low: tuple[float, ...], high: tuple[float, ...]) -> tuple[Floats, Any]:
    """Vertices (8,3) and faces (12,3) of a box between the corners ``low`` and ``high``."""
    corner = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float)
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = [t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))]
    return np.array(low) + corner * (np.array(high) - np.array(low)), np.array(faces)


class BlockContract(PlacementContract):
    """A scene with a block, for four contracts."""

    tolerance: ClassVar[float] = 0.1

    def make_scene(self) -> dict[str, Any]:
        bite, inside = make_block((3, 1, 1), (5, 2, 3)), make_block((3, 1, 1), (4, 2, 2))
        return {
            "part": Part(*make_block((0, 0, 0), SIZE)),
            "solid": Solid(*bite),
            "damage": Solid(*inside),
            "enclosure": Mesh(*bite),
            "tolerance": self.tolerance,
        }

    def check_agrees(self, got: Any, expected: Any, scale: float, turn: Floats, shift: Floats) -> None:
        """Compares the extents along the axes of the unchanged scene, and the volumes."""
        if expected is None or got is None:
            assert got is expected
            return
        found, target = undo_placement(_get_points(got), scale, turn, shift), _get_points(expected)
        assert np.allclose([found.min(0), found.max(0)], [target.min(0), target.max(0)], atol=1e-6)
        if isinstance(expected, Solid):
            assert got.volume / scale**3 == pytest.approx(expected.volume, rel=1e-6)


class SampleContract(BlockContract):
    """Checks for `sample`."""

    def test_lies_on_the_part(self) -> None:
        points = self.get_result().points
        assert np.abs(np.minimum(points, np.array(SIZE) - points).min(axis=1)).max() < 1e-9

    def test_leaves_no_gap_larger_than_it_says(self) -> None:
        from scipy.spatial import cKDTree

        samples = self.get_result()
        everywhere, _ = _scene.sample_points(self.make_inputs()["part"], 20_000, np.random.default_rng(5))
        assert np.max(cKDTree(samples.points).query(everywhere)[0]) <= samples.spacing

    def test_half_the_tolerance_half_the_spacing(self) -> None:
        assert self.run(tolerance=self.tolerance / 2).spacing == pytest.approx(self.get_result().spacing / 2, rel=0.05)


class RepairContract(BlockContract):
    """Checks for `repair`."""

    def test_an_empty_mesh_is_refused(self) -> None:
        with pytest.raises(REFUSED):
            self.run(enclosure=Mesh(np.zeros((0, 3)), np.zeros((0, 3), int)))

    def test_an_open_mesh(self) -> None:
        box = self.make_inputs()["enclosure"]

        def check(solid: Solid) -> None:
            assert solid.volume == pytest.approx(4)

        check_or_refused(lambda: self.run(enclosure=Mesh(box.vertices, box.faces[1:])), check)

    def test_what_is_closed_keeps_its_volume(self) -> None:
        assert self.get_result().volume == pytest.approx(4)


class BooleanContract(BlockContract):
    """Checks for `boolean`."""

    def test_gives_what_lies_in_the_part(self) -> None:
        assert self.get_result().volume == pytest.approx(1)

    def test_the_part_and_itself(self) -> None:
        assert self.run(solid=self.make_inputs()["part"]).volume == pytest.approx(np.prod(SIZE))

    def test_apart_gives_none(self) -> None:
        assert self.run(solid=Solid(*make_block((9, 9, 9), (10, 10, 10)))) is None


class AllowanceContract(BlockContract):
    """Checks for `allowance`."""

    def make_scene(self) -> dict[str, Any]:
        """The block, with the damage of another site at its far end."""
        return {**super().make_scene(), "others": Solid(*make_block((0, 0, 0), (0.5, 0.5, 0.5)))}

    def test_deposit_holds_the_damage(self) -> None:
        deposit = self.get_result()
        assert deposit is None or deposit.volume >= self.make_inputs()["damage"].volume

    def test_alone_on_the_part(self) -> None:
        deposit = self.run(others=None)
        assert deposit is None or deposit.volume >= self.make_inputs()["damage"].volume

    def test_the_cavity_holds_the_damage_and_is_filled(self) -> None:
        deposit = self.get_result()
        if not isinstance(deposit, Deposit):
            pytest.skip("it gives no deposit with figures")
        damage, given = to_manifold(self.make_inputs()["damage"]), to_manifold(deposit)
        cavity = to_manifold(deposit.cavity) if deposit.cavity else damage
        others = to_manifold(self.make_inputs()["others"])
        assert (damage - cavity).volume() <= 1e-6
        assert (cavity - given).volume() <= 1e-6
        assert (cavity ^ others).volume() <= 1e-6
        assert deposit.stock_volume == pytest.approx(deposit.volume - cavity.volume(), abs=1e-6)
        assert deposit.cut_back_volume == pytest.approx(cavity.volume() - damage.volume(), abs=1e-6)


def _get_points(output: Any) -> Floats:
    return np.asarray(output.points if isinstance(output, Samples) else output.vertices)
