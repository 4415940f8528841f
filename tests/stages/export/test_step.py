"""A result as STEP, read back by CadQuery."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from damageest.registry import Registry
from damageest.stages.export.files import Files
from damageest.units import MILLIMETRES
from tests.stages.export import results

cq: Any = pytest.importorskip("cadquery")


@pytest.mark.parametrize("units", ["mm", "in"])
@pytest.mark.parametrize("detail", [None, 0.0])
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
