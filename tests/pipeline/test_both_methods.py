"""`method: both`: each site has its volume by the other method, and one that the other contradicts is doubtful."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import wraps
from pathlib import Path

import pytest
import trimesh

import damageest
from damageest.artefacts import Enclosures, Solid
from damageest.pipeline.finding.other_method import note_other_volumes
from damageest.pipeline.state import FoundSite
from damageest.registry import Registry
from damageest.result import Result
from damageest.stages.enclose.implicit import Implicit
from tests import damaged_box


def make_site(clusters: tuple[int, ...], edge: float) -> FoundSite:
    cube = trimesh.creation.box((edge, 1, 1))
    return FoundSite(clusters=clusters).with_value(FoundSite.damage, Solid(cube.vertices, cube.faces), "cube")


def test_volumes_are_compared_over_the_same_clusters() -> None:
    """Two sites of one method may be one of the other; what the other has nothing for is not known."""
    first = (make_site((1,), 3.0), make_site((2,), 1.0), make_site((3,), 5.0))
    second = (make_site((1, 2), 4.4),)
    noted = note_other_volumes(first, first, second)
    assert [site.other_volume for site in noted[:2]] == pytest.approx([3.3, 1.1])
    assert noted[2].other_volume is not None
    assert math.isnan(noted[2].other_volume)
    (joined,) = note_other_volumes(second, first, second)
    assert joined.other_volume == pytest.approx(4.0)


def run(folder: Path, registry: Registry, **changes: object) -> Result:
    job = damaged_box.write_least(folder, "method: both\n")
    return damageest.run(job, registry=registry, output=False, settings=changes)


@pytest.mark.slow
def test_methods_that_agree_leave_the_verdict(registry: Registry, tmp_path: Path) -> None:
    (site,) = run(tmp_path, registry).sites
    (reason,) = [one for one in site.verdict.reasons if one.code == "other_method"]
    assert reason.effect == "note"
    assert reason.amount == pytest.approx(0, abs=0.08 * site.damage.volume)
    assert site.verdict.level != "doubtful"
    assert site.damage.volume == pytest.approx(damaged_box.TRUE_VOLUME, rel=0.08)


@pytest.mark.slow
def test_a_method_that_is_wrong_is_contradicted(
    registry: Registry, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The loss is enclosed 1.3 times as high above its floor as it is: points and rim agree still."""
    right = Implicit.run

    def raise_top(solid: Solid) -> Solid:
        vertices = solid.vertices.copy()
        below = vertices[:, 2] < 10 - 1e-3
        vertices[below, 2] = 10 + 1.25 * (vertices[below, 2] - 10)
        return replace(solid, vertices=vertices)

    @wraps(right)
    def run_wrong(self: Implicit, *given: object, **named: object) -> Enclosures:
        found = right(self, *given, **named)
        return replace(found, items=tuple(replace(one, solid=raise_top(one.solid)) for one in found.items))

    monkeypatch.setattr(Implicit, "run", run_wrong)
    (site,) = run(tmp_path, registry).sites
    effects = {one.code: one.effect for one in site.verdict.reasons}
    assert effects["other_method"] == "contradicts"
    assert site.verdict.level == "doubtful"
