"""That the part as designed explains the intact skin is said only where nothing speaks against it."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest

import damageest
from damageest.artefacts import Floats, Part, Scan
from damageest.geometry.solids import to_arrays
from damageest.result import Result
from tests import surplus_scenes as scenes

TOLERANCE = 0.2
SAID = "the part as designed explains"
SETTINGS = ["align=none", "allowance=none", f"tolerance={TOLERANCE}"]


def run(points: Floats, settings: list[str] = SETTINGS, part: Part | None = None) -> Result:
    return damageest.run({"version": 1}, part=part or scenes.part(), scan=Scan(points), settings=settings)


def scan(actual: Any, count: int = 5000) -> Floats:
    return scenes.scan(actual, count)


@pytest.fixture(scope="module")
def dented() -> Floats:
    return scan(scenes.block() - scenes.ball(2.5, 5, 4, 6))


@pytest.mark.slow
def test_it_is_said_of_a_damaged_part(dented: Floats) -> None:
    result = run(dented)
    assert result.fit is not None
    assert (result.fit.model, result.fit.words) == ("ok", "the part as designed explains the intact skin")
    assert len(result.sites) == 1


@pytest.mark.slow
def test_it_is_said_beside_a_weld_bead() -> None:
    result = run(scan(scenes.block() + scenes.slab((6, 3, 2), 0, 0, 6.8)))
    assert result.fit is not None
    assert len(result.surplus) == 1
    assert result.fit.model == "ok"


@pytest.mark.slow
def test_it_is_not_said_beside_sites_that_the_pose_makes(dented: Floats) -> None:
    result = run(dented + np.array([0.196, 0.0, 0.0]))
    assert result.fit is not None
    shallow = [site.id for site in result.sites if site.verdict.level == "doubtful"]
    assert shallow
    assert result.fit.model == "open"
    assert not result.fit.words.startswith(SAID)
    assert re.search(rf"site.* {shallow[-1]}\b.* may be deviating skin", result.fit.words)
    assert result.fit.words in [note.text for note in result.warnings]


@pytest.mark.slow
def test_it_is_not_said_beside_a_large_surplus() -> None:
    result = run(scan(scenes.block() + scenes.slab((22, 16, 3), 0, 0, 7), 3000))
    assert result.fit is not None
    assert result.fit.model == "open"
    assert "outside the part" in result.fit.words


@pytest.mark.slow
def test_it_is_not_said_of_a_doubtful_pose() -> None:
    """The pocket in the bottom was not seen: poses that are no symmetries of the part fit as well."""
    part = Part(*to_arrays(scenes.block() - scenes.slab((6, 5, 4), 5, 3, scenes.TOP - 12)))
    points = scan(scenes.block(), 8000)
    result = run(points[points[:, 2] > 2], ["allowance=none", f"tolerance={TOLERANCE}"], part)
    assert result.pose.doubts
    assert result.fit is not None
    assert result.fit.model == "open"
    assert "the pose is doubtful" in result.fit.words


def test_it_is_said_of_no_more_than_was_seen() -> None:
    points = scan(scenes.block())
    result = run(points[points[:, 2] > scenes.TOP - 1])
    assert result.fit is not None
    assert result.fit.model == "ok"
    said = re.fullmatch(
        rf"{SAID} the intact skin that was seen, (\d+) % of the part's(; a scale wrong .*)?", result.fit.words
    )
    assert said, result.fit.words
    assert 15 < float(said[1]) < 45  # the upper face, with a little of the sides
