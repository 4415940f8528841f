"""Cavities that are opened or cut back before deposition: exact deposits, and exact metal to mill off."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import cadquery_faults
import pytest
from damageest_cadquery import exact
from damageest_cadquery.reading.list_faces import list_faces
from damageest_cadquery.reading.read import read
from damageest_cadquery.solids.joining import StockError
from damageest_cadquery.solids.split import measure_volume, triangulate
from damageest_cadquery.stock.opened import find_milled

import damageest
from damageest.artefacts import Deposit
from damageest.geometry.solids import to_manifold
from damageest.registry import Registry
from damageest.result import Result
from damageest.stages.export.files import Files
from tests.needs import import_for, needs_plugin

pytestmark = [needs_plugin("cadquery"), pytest.mark.slow]
cq = import_for("cadquery", "cadquery")

BALL: dict[str, Any] = {"tool": "sphere", "centre": [2, 3, 4], "radius": 4}
"""Its widest place lies 2 below the top: an undercut."""
CHIP = {"tool": "box", "centre": [15, 0, 6], "size": [8, 5, 6]}


@dataclass(frozen=True)
class Run:
    result: Result
    folder: Path
    said: list[dict[str, Any]]

    def read(self, stem: str) -> Any:
        """The one solid of a STEP file."""
        (solid,) = cq.importers.importStep(str(self.folder / f"{stem}.step")).solids().vals()
        assert solid.isValid()
        return solid


def run(place: Path, **allowance: Any) -> Run:
    cq.exporters.export(cq.Workplane().box(30, 20, 12), str(place / "block.step"))
    job = {
        "version": 1, "units": "mm", "tolerance": 0.2, "part": str(place / "block.step"), "align": "none",
        "scan": {"use": "simulate", "points": 25000, "noise": 0.04, "seed": 4, "damage": [BALL, CHIP]},
        "accept": "all", "allowance": {"use": "milling", "outer": 0.5, **allowance}, "export": {"format": ["step"]},
        "report": "none",
    }  # fmt: skip
    result = damageest.run(job, output=place / "out")
    return Run(result, place / "out", json.loads((place / "out/result.json").read_text())["sites"])


@pytest.fixture(scope="module")
def opened(tmp_path_factory: pytest.TempPathFactory) -> Run:
    return run(tmp_path_factory.mktemp("opened"), prepare={"min_radius": 1.0, "wall_angle": 20})


def find_ball(done: Run) -> int:
    return next(site.id for site in done.result.sites if site.damage.bounds.mean(axis=0)[0] < 8)


def measure_common(first: Any, second: Any) -> float:
    """The volume that two solids have in common, by their triangles."""
    bodies = [to_manifold(triangulate(solid.wrapped, 0.005)) for solid in (first, second)]
    return float((bodies[0] ^ bodies[1]).volume())


def test_deposit_and_metal_to_mill_off_have_the_cad_faces(opened: Run) -> None:
    for site, said in zip(opened.result.sites, opened.said, strict=True):
        made = site.deposit
        assert isinstance(made, Deposit)
        assert made.milled is not None
        assert made.cavity is not None
        form = said["exact"]["milled"]
        assert (form["reason"], said["exact"]["deposit"]["reason"]) == ("", "")
        assert form["form"] in ("shapes", "spline", "planes", "facets")
        # a tenth of shapes and planes may be farther than a quarter of the tolerance: the mesh rounds their edges
        assert form["beyond"] <= (0.1 if form["form"] in ("shapes", "planes") else 0.02)
        assert form["distance"] <= opened.result.tolerance / 3
        milled = opened.read(f"milled/site-{site.id}")
        assert milled.Volume() == pytest.approx(form["volume"], rel=1e-4)
        assert milled.Volume() == pytest.approx(made.milled.volume, abs=0.003 * made.cavity.volume)
        assert len(milled.Faces()) == form["faces"] > form["prepared_faces"] > 0
        assert said["files"]["milled"] == f"milled/site-{site.id}.step"


def test_what_is_milled_off_is_what_the_deposit_fills_beside_the_damage(opened: Run) -> None:
    for site in opened.result.sites:
        lost, milled = opened.read(f"damage/site-{site.id}"), opened.read(f"milled/site-{site.id}")
        deposit, left = opened.read(f"deposit/site-{site.id}"), opened.read("undamaged")
        assert measure_common(milled, lost) < 1e-3 * lost.Volume()
        assert measure_common(milled, left) == pytest.approx(milled.Volume(), rel=0.01)
        assert measure_common(milled, deposit) == pytest.approx(milled.Volume(), rel=0.01)
        assert measure_common(lost, deposit) == pytest.approx(lost.Volume(), rel=3e-3)


def test_the_cavity_is_open_upwards(opened: Run) -> None:
    """Each place of the exact ball mark lies under free space or under what is milled off."""
    number = find_ball(opened)
    # above where the ball is widest
    pin = cq.Workplane().circle(3.8).extrude(10).translate((2, 3, 4.0)).val()
    over, milled = measure_common(pin, opened.read("undamaged")), opened.read(f"milled/site-{number}")
    assert over > 1.0
    assert measure_common(pin, milled) > 0.98 * over


def test_faces_are_named_by_what_leaves_them(opened: Run) -> None:
    number = find_ball(opened)
    folder = opened.folder
    names = [face.name for face in list_faces(read(folder / f"milled/site-{number}.step", ".step"), 1.0)]
    prepared = [name for name in names if name.startswith(f"prepared site-{number} inner ")]
    found = [name for name in names if name.startswith(f"damage site-{number} inner ")]
    kept = [name for name in names if name.startswith("face ")]
    assert len(prepared) == opened.said[number - 1]["exact"]["milled"]["prepared_faces"]
    assert len(prepared) + len(found) + len(kept) == len(names)
    assert found
    assert kept
    deposit = [face.name for face in list_faces(read(folder / f"deposit/site-{number}.step", ".step"), 1.0)]
    assert any(name.startswith(f"prepared site-{number} inner ") for name in deposit)
    assert any(name.startswith("stock on face ") for name in deposit)
    assert not any(name.startswith("damage ") for name in deposit)
    assert f"PRODUCT('to be milled site-{number}'" in (folder / "result.step").read_text()


def test_as_cadquery_gives_the_metal_to_mill_off(opened: Run) -> None:
    number = find_ball(opened)
    shape, said = opened.result.as_cadquery("milled", number), opened.said[number - 1]["exact"]["milled"]
    assert measure_volume(shape.wrapped) == pytest.approx(said["volume"], rel=1e-4)


@pytest.mark.parametrize(
    ("fault", "form", "deposit"),
    [
        (cadquery_faults.abort_at_opened, "none", "its opened cavity has facets too"),
        (cadquery_faults.abort_at_milled, "facets", ""),
    ],
    ids=["opened", "milled"],
)
def test_a_fault_of_opencascade_costs_only_what_it_works_at(
    fault: Any, form: str, deposit: str, opened: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(exact, "make_exact", fault)
    site = opened.result.sites[2 - find_ball(opened)]
    folder = tmp_path / "out"
    folder.mkdir()
    stage = Files.model_validate({"format": ["step"]})
    done = stage.run(replace(opened.result, sites=(site,)), folder, Registry.discover().writers)
    told = done.exact[site.id]
    assert told.form != "none"
    assert told.deposit is not None
    assert told.milled is not None
    assert told.deposit.reason == deposit
    assert (told.milled.form == "none") == (form == "none")
    assert "SIGABRT" in told.milled.reason
    assert any(note.startswith(f"milled/site-{site.id}.step has facets") for note in done.warnings)
    assert (folder / f"milled/site-{site.id}.step").is_file()


def test_metal_of_another_volume_is_refused(opened: Run) -> None:
    """The mesh has another opening than the exact cavity."""
    made = opened.result.sites[0].deposit
    assert isinstance(made, Deposit)
    assert made.milled is not None
    box = cq.Workplane().box(30, 20, 12)
    pieces = {name: cut_ball(box, radius) for name, radius in (("cavity", 5.0), ("damage", 4.0))}
    with pytest.raises(StockError, match="its volume differs"):
        find_milled(pieces["cavity"], pieces["damage"], made, opened.result.part, 0.2)


def cut_ball(box: Any, radius: float) -> Any:
    """An exact pit in the top of a block."""
    from damageest_cadquery.cutting.check_pieces import Measured
    from damageest_cadquery.cutting.exact_damage import Exact
    from damageest_cadquery.solids.joining import explore_faces
    from damageest_cadquery.solids.split import Piece

    solid = box.intersect(cq.Workplane().sphere(radius).translate((2, 3, 6))).val().Solids()[0].wrapped
    flat = [cq.Face(face).Center().z > 5.99 for face in explore_faces(solid)]
    origins = tuple((1, -1) if each else (-1, 0) for each in flat)
    return Exact((Piece(solid, 0, origins),), (), "shapes", Measured(measure_volume(solid)), 0.0)


def test_a_cavity_that_is_cut_back_is_exact_too(tmp_path: Path) -> None:
    done = run(tmp_path, inner=0.4)
    for site, said in zip(done.result.sites, done.said, strict=True):
        assert said["exact"]["form"] != "none"
        assert said["exact"]["milled"] is None
        assert said["exact"]["deposit"]["reason"] == ""
        lost, deposit = done.read(f"damage/site-{site.id}"), done.read(f"deposit/site-{site.id}")
        assert lost.Volume() == pytest.approx(site.damage.volume, rel=3e-3)
        assert measure_common(lost, deposit) == pytest.approx(lost.Volume(), rel=3e-3)
    number = find_ball(done)
    low = done.read(f"damage/site-{number}").BoundingBox().zmin
    assert low == pytest.approx(BALL["centre"][2] - BALL["radius"] - 0.4, abs=done.result.tolerance)
    left = done.read("undamaged").Volume()
    lost_volume = sum(done.read(f"damage/site-{site.id}").Volume() for site in done.result.sites)
    assert left + lost_volume == pytest.approx(30 * 20 * 12, rel=1e-6)
