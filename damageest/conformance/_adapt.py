"""The checks for `adapt`, on a scan of the prism as it was designed, and on one of a prism that is bent."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, ClassVar

import numpy as np
import pytest

from damageest.artefacts import DAMAGE, AdaptedPart, Floats, Scan
from damageest.conformance import _scene
from damageest.conformance._base import PlacementContract, check_or_refused
from damageest.geometry.distance import signed_distance

BEND = 2 * _scene.TOLERANCE
"""How far the ends of the bent prism are off its middle."""


def bend(points: Floats) -> Floats:
    """Points (N,3) of a prism whose ends are turned up: its axis is an arc."""
    half = float(np.abs(_scene.OUTLINE[:, 0]).max())
    angle = 2 * BEND / half**2 * points[:, 0]
    along = np.sinc(angle / np.pi) * points[:, 0] - points[:, 2] * np.sin(angle)
    up = points[:, 0] * np.sinc(angle / (2 * np.pi)) * np.sin(angle / 2) + points[:, 2] * np.cos(angle)
    return np.stack([along, points[:, 1], up], axis=1)


class AdaptContract(PlacementContract):
    """Checks for `adapt`. ``off``: how far the skin of the adapted part may lie off the intact skin of the bent prism,
    in tolerances, where it is adapted at all."""

    off: ClassVar[float] = 0.5

    def make_bent(self) -> Scan:
        """The scan of the bent prism, with its dents."""
        aligned: Scan = _scene.make_scene().aligned
        return replace(aligned, points=bend(aligned.points), normals=None)

    def adapt_bent(self) -> AdaptedPart | None:
        """What it makes of that scan. It is computed once."""
        key = f"bent {self.stage!r}"
        if key not in self._results:
            self._results[key] = self.run(aligned=self.make_bent()), []
        adapted: AdaptedPart | None = self._results[key][0]
        return adapted

    def test_gives_its_type(self) -> None:
        assert self.get_result() is None or isinstance(self.get_result(), AdaptedPart)

    def test_a_part_as_designed_stays_so(self) -> None:
        adapted = self.get_result()
        assert adapted is None or adapted.amount < 0.25 * _scene.TOLERANCE

    def test_follows_skin_and_not_damage(self) -> None:
        scan = self.make_bent()
        adapted = self.adapt_bent()
        if adapted is None:
            pytest.skip("it does not deform")
        label = _scene.make_scene().deviation.label
        distance, _ = signed_distance(scan.move(adapted.motion).points, adapted.part)
        assert np.quantile(np.abs(distance[label != DAMAGE]), 0.95) < self.off * _scene.TOLERANCE
        deepest = float(-_scene.make_scene().deviation.distance.min())
        assert -distance[label == DAMAGE].min() > 0.9 * deepest, "it follows the dents"

    def test_what_it_says_is_what_it_did(self) -> None:
        adapted = self.adapt_bent()
        if adapted is None:
            pytest.skip("it does not deform")
        before = adapted.part.vertices - adapted.displacement
        distance, _ = signed_distance(before, self.make_inputs()["part"])
        assert np.abs(distance).max() < 1e-6 * adapted.part.diagonal
        if adapted.field is not None:
            assert np.abs(adapted.field.displace(before) - adapted.displacement).max() < 0.01 * _scene.TOLERANCE
        length = np.linalg.norm(adapted.displacement, axis=1)
        assert adapted.rms <= adapted.amount <= 1.2 * length.max()

    @pytest.mark.parametrize("count", [0, 1, 30])
    def test_few_points(self, count: int) -> None:
        def check(adapted: AdaptedPart | None) -> None:
            assert adapted is None or adapted.amount < _scene.TOLERANCE

        check_or_refused(lambda: self.run(aligned=_scene.make_scene().aligned.take(np.arange(count))), check)

    def check_agrees(self, got: Any, expected: Any, scale: float, turn: Floats, shift: Floats) -> None:
        assert got is None or isinstance(got, AdaptedPart)
        assert (got is None) == (expected is None)
        if got is not None:
            assert got.amount / scale == pytest.approx(expected.amount, rel=1e-2, abs=0.05 * _scene.TOLERANCE)
            placed = _scene.transform(expected.part, scale, turn, shift)
            assert np.abs(got.part.bounds - placed.bounds).max() < 0.05 * _scene.TOLERANCE * scale
