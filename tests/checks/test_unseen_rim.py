"""The share of a rim beside skin that the scan does not show, on a box with a groove from end to end."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
import trimesh

import damageest
from damageest.artefacts import Part, Scan, Solid
from damageest.checks.unseen_rim import measure_unseen_rim
from damageest.stages.scan.simulate import Simulate
from tests import damaged_box

LEAST = {"version": 1, "tolerance": 0.2, "align": "none"}


@cache
def scan_dent(kept: float) -> tuple[damageest.Result, Solid]:
    """A run on a box with a dent, without the points of its top beyond x = ``kept``; and the true damage."""
    part = damaged_box.box()
    tool = {"tool": "sphere", "centre": [0, 0, 13], "radius": 8}
    scan = Simulate.model_validate({"damage": [tool], "points": 10_000, "noise": 0.04}).run("mm", part)
    points = scan.points[(scan.points[:, 0] < kept) | (scan.points[:, 2] < 5)]
    assert scan.truth is not None
    assert scan.truth.damage is not None
    return damageest.run(LEAST, part=part, scan=Scan(points)), scan.truth.damage


def measure(result: damageest.Result, damage: Solid) -> float:
    assert result.coverage is not None
    return measure_unseen_rim(damage, result.part, result.coverage, 1.0)


@pytest.mark.slow
def test_a_rim_that_the_scan_shows_has_no_share() -> None:
    result, damage = scan_dent(100)
    assert measure(result, damage) == 0
    assert result.sites[0].verdict.level == "proven"


@pytest.mark.slow
@pytest.mark.parametrize(("kept", "share"), [pytest.param(0.0, 0.5, marks=pytest.mark.slow), (3.0, 0.38)])
def test_the_share_is_that_of_the_rim_in_the_unseen_skin(kept: float, share: float) -> None:
    result, damage = scan_dent(kept)
    assert measure(result, damage) == pytest.approx(share, abs=0.12)
    site = result.sites[0]
    assert site.verdict.level == "likely"
    assert site.volume_95 is not None
    assert site.volume_95[0] <= damage.volume < site.volume_95[1] == np.inf


@pytest.mark.slow
def test_a_solid_without_a_rim_has_no_share() -> None:
    result, _ = scan_dent(3.0)
    ball = trimesh.creation.icosphere(2, 2.0)
    assert measure(result, Solid(np.asarray(ball.vertices), np.asarray(ball.faces))) == 0
    assert isinstance(result.part, Part)
