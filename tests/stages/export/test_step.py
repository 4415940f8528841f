"""A result as STEP, read back by CadQuery."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from damageest.artefacts import Surface
from damageest.geometry.units import MILLIMETRES
from damageest.output.result_json import build_report
from damageest.registry import Registry
from damageest.stages.export.files import Files
from tests.needs import import_for, needs_plugin
from tests.stages.export import results

pytestmark = needs_plugin("cadquery")
cq = import_for("cadquery", "cadquery")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("detail", "units"),
    [
        (None, "in"),
        *(pytest.param(*case, marks=pytest.mark.slow) for case in ((None, "mm"), (0.0, "in"), (0.0, "mm"))),
    ],
)
def test_volumes_and_unit(units: str, detail: float | None, tmp_path: Path, registry: Registry) -> None:
    scale = MILLIMETRES[units]
    result = results.make(units, 1 / scale)
    stage = Files(format=("step",), frame="both", detail=detail)
    written = stage.run(result, tmp_path, registry.writers)
    assert written.notes == ()
    assert result.damage is not None
    assert result.undamaged is not None
    solids = {"damage": result.damage, "undamaged": result.undamaged}
    solids |= {f"damage/site-{site.id}": site.damage for site in result.sites}
    solids |= {f"deposit/site-{site.id}": site.deposit for site in result.sites if site.deposit}
    files = {name for name in written.files if name.endswith(".step")}
    assert files == {f"{place}{stem}.step" for stem in solids for place in ("", "scan_frame/")}
    for name in sorted(files):
        stem = name.removeprefix("scan_frame/").removesuffix(".step")
        bodies = cq.importers.importStep(str(tmp_path / name)).solids().vals()  # in millimetres, whatever the file's
        assert all(body.isValid() for body in bodies)
        assert sum(body.Volume() for body in bodies) == pytest.approx(
            solids[stem].volume * scale**3, rel=5e-3 if detail is None else 1e-6
        )
    low, high = (side.tolist() for side in result.undamaged.bounds * scale)
    box = cq.importers.importStep(str(tmp_path / "undamaged.step")).combine().val().BoundingBox()
    assert (box.xmin, box.ymin, box.zmin) == pytest.approx(low, abs=1e-4)
    assert (box.xmax, box.ymax, box.zmax) == pytest.approx(high, abs=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize("units", ["in", pytest.param("mm", marks=pytest.mark.slow)])
def test_inner_damage_surfaces_as_splines(units: str, tmp_path: Path, registry: Registry) -> None:
    scale = MILLIMETRES[units]
    result = results.make(units, 1 / scale)
    sharp = replace(result.sites[1], surface=Surface(result.part.vertices, result.part.faces))
    result = replace(result, sites=(result.sites[0], sharp))
    stage = Files(frame="both", spline=True)
    written = stage.run(result, tmp_path, registry.writers)
    assert {name for name in written.files if name.endswith(".step")} == {
        "surface/site-1.step",
        "scan_frame/surface/site-1.step",
    }
    said = build_report(result, written)["sites"]
    assert said[0]["spline"]["reason"] == ""
    assert said[0]["spline"]["trimmed"]
    assert 0 < said[0]["spline"]["deviation"] <= result.tolerance
    assert "surface/site-1.step" in said[0]["files"]["every"]
    assert said[0]["files"]["surface"] == "surface/site-1.ply"
    assert "no height field" in said[1]["spline"]["reason"]
    T = np.linalg.inv(result.pose.T_part_scan)
    for name, move in (("surface/site-1.step", np.eye(4)), ("scan_frame/surface/site-1.step", T)):
        (face,) = cq.importers.importStep(str(tmp_path / name)).faces().vals()
        points = result.sites[0].surface.vertices[np.unique(result.sites[0].surface.faces)][::200]
        for point in (points @ move[:3, :3].T + move[:3, 3]) * scale:
            assert face.distance(cq.Vertex.makeVertex(*point.tolist())) <= result.tolerance * scale
    for k in range(2):
        (tmp_path / str(k)).mkdir()
        stage.run(result, tmp_path / str(k), registry.writers)
    assert (tmp_path / "0/surface/site-1.step").read_bytes() == (tmp_path / "1/surface/site-1.step").read_bytes()
    assert build_report(result)["sites"][0]["spline"] is None
