"""The checks for the stage `path`."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from damageest.artefacts import DepositPath, Part, Solid
from damageest.conformance._base import StageContract
from damageest.conformance._contracts import SIZE, make_block
from damageest.geometry.distance import distance_to_mesh, is_inside
from damageest.geometry.solids import to_manifold, to_solid


class PathContract(StageContract):
    """Checks for `path`, on a block of 4 x 3 x 2 with a bite of 1 x 1 x 1 out of an upper edge.

    An implementation that gives no path passes.
    """

    def make_scene(self) -> dict[str, Any]:
        part, bite = Part(*make_block((0, 0, 0), SIZE)), Solid(*make_block((3, 1, 1), (4, 2, 2)))
        left = to_solid(to_manifold(part) - to_manifold(bite))
        return {"body": bite, "part": part, "left": left, "built": None, "tolerance": 0.01, "reach": None}

    def run_path(self, **changes: Any) -> DepositPath:
        """The path, with some inputs replaced by ``changes``. Skips the check where there is none."""
        path = self.run(**changes) if changes else self.get_result()
        if path is None:
            pytest.skip("it gives no path")
        assert isinstance(path, DepositPath)
        return path

    def test_beads_lie_at_the_deposit(self) -> None:
        path, body = self.run_path(), self.make_inputs()["body"]
        places = path.points[path.on]
        far = distance_to_mesh(places, body) * ~is_inside(places, body)
        assert far.max(initial=0.0) <= path.width + path.heights.max()

    def test_what_is_not_filled_is_said(self) -> None:
        path, body = self.run_path(), self.make_inputs()["body"]
        assert path.deposit_volume == pytest.approx(body.volume)
        assert 0 <= path.unreached_volume <= body.volume * (1 + 1e-6)
        assert path.bead_volume >= 0.8 * (body.volume - path.unreached_volume)

    def test_layers_and_passes_are_numbered(self) -> None:
        path = self.run_path()
        assert path.number.min(initial=1) >= 1
        assert (np.diff(path.number) >= 0).all()
        assert path.layer.min(initial=1) >= 1
        assert (np.diff(path.layer)[np.diff(path.part) == 0] >= 0).all(), "a layer stands on the one before"

    def test_beside_another_deposit(self) -> None:
        other = Solid(*make_block((0, 1, 1), (1, 2, 2)))
        assert self.run_path(built=other).unreached_volume <= self.make_inputs()["body"].volume * (1 + 1e-6)

    def test_nothing_left_of_the_part(self) -> None:
        assert self.run_path(left=None).deposit_volume > 0
