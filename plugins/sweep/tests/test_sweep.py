"""Shallow damage of known truth is right; damage that a sweep cannot represent is refused."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import trimesh
from damageest_evaluate.scores import iou
from damageest_sweep.sweep import Sweep

import damageest
from damageest.artefacts import Mesh, Part, Rims, Scan, Truth
from damageest.conformance import EncloseContract
from damageest.errors import StageError
from damageest.result import Result
from damageest.stages.scan.simulate import Simulate

SIGMA = 0.03
BOX = trimesh.creation.box((40, 30, 20))
SMALL = trimesh.creation.box(bounds=((-15, -8, 2), (15, 8, 10)))
"""Its top lies as that of the other; a scan of it needs fewer points."""


def scan_box(*tools: dict[str, Any], box: Any = SMALL, points: int = 8000) -> tuple[Part, Scan]:
    part = Part(box.vertices, box.faces)
    scan = Simulate.model_validate({"damage": tools, "points": points, "noise": SIGMA, "seed": 3}).run("mm", part)
    return part, scan


def run(part: Part, scan: Scan, **options: Any) -> Result:
    job = {"version": 1, "align": "none", "tolerance": 4 * SIGMA, "enclose": {"use": "sweep", **options}}
    return damageest.run(job, part=part, scan=Scan(scan.points))


def ball(*centre: float, radius: float) -> dict[str, Any]:
    return {"tool": "sphere", "centre": list(centre), "radius": radius}


def rod(*point: float, axis: list[float], length: float, radius: float) -> dict[str, Any]:
    return {"tool": "cylinder", "point": list(point), "axis": axis, "length": length, "radius": radius}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("tools", "least", "box", "points"),
    [
        ([rod(0, 0, 70, axis=[0, 1, 0], length=100, radius=61)], 0.95, SMALL, 16_000),
        *(
            pytest.param(tools, least, BOX, 60_000, marks=pytest.mark.slow)
            for tools, least in (
                ([rod(0, 0, 70, axis=[0, 1, 0], length=100, radius=61)], 0.97),
                ([ball(3, 2, 28, radius=20)], 0.985),
                ([ball(20, 0, 10, radius=8)], 0.99),
                ([ball(20, 15, 10, radius=8)], 0.99),
                ([ball(-10, 0, 28, radius=20), ball(10, 5, 28, radius=20)], 0.985),
            )
        ),
    ],
    ids=["small wear", "wear from edge to edge", "dent", "edge", "corner", "two dents"],
)
def test_shallow_damage_is_right(tools: list[dict[str, Any]], least: float, box: Any, points: int) -> None:
    part, scan = scan_box(*tools, box=box, points=points)
    result = run(part, scan)
    assert isinstance(scan.truth, Truth)
    assert scan.truth.damage is not None
    assert result.status == "ok"
    assert all(site.evidence.consistent and site.method == "surface" for site in result.sites)
    assert iou([site.damage for site in result.sites], [scan.truth.damage]) > least


@pytest.mark.slow
@pytest.mark.parametrize(
    "tool",
    [
        ball(0, 0, 10, radius=6),
        pytest.param(ball(0, 0, 7, radius=5), marks=pytest.mark.slow),
        pytest.param(rod(0, 0, 6, axis=[0, 0, 1], length=10, radius=3), marks=pytest.mark.slow),
        pytest.param(rod(0, 0, 0, axis=[0, 0, 1], length=40, radius=4), marks=pytest.mark.slow),
    ],
    ids=["steep sides", "undercut", "deep pit", "worn through"],
)
def test_what_a_sweep_cannot_represent_is_refused(tool: dict[str, Any]) -> None:
    with pytest.raises(StageError, match="enclose: sweep") as caught:
        run(*scan_box(tool))
    assert "divide" in caught.value.remedy


@pytest.mark.slow
def test_an_option_decides_what_is_too_steep() -> None:
    part, scan = scan_box(ball(3, 2, 28, radius=20))
    with pytest.raises(StageError, match="steeper than 10 degrees"):
        run(part, scan, steepest=10)


class TestSweep(EncloseContract):
    stage = Sweep(steepest=89)


def test_several_rims_are_refused() -> None:
    scene = TestSweep().make_inputs()
    loop = scene["rims"].loops[0]
    wanted = {name: scene[name] for name in Sweep.needs()}
    with pytest.raises(StageError, match="2 rims"):
        Sweep().run(**{**wanted, "rims": Rims((loop, loop))})


def test_intact_points_inside_are_refused() -> None:
    scene = TestSweep().make_inputs()
    wanted = {name: scene[name] for name in Sweep.needs()}
    enclosure = Sweep(steepest=89).run(**wanted)
    assert isinstance(enclosure, Mesh)
    centre = scene["surface"].vertices.mean(axis=0) + np.array([0, 0, 1.5])
    cloud = centre + 0.2 * np.random.default_rng(1).normal(size=(500, 3))
    with pytest.raises(StageError, match="intact scan points lie inside"):
        Sweep(steepest=89).run(**{**wanted, "intact": np.concatenate([scene["intact"], cloud])})
