"""CAD files of others, of one solid and of many: damage and deposit with the CAD's faces, read back from the files.

Each loses a ball of a fourteenth of its diagonal at the middle of its longest sharp edge, and gets stock of 0.3 mm.
"""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from pathlib import Path

import pytest

import damageest
from tests.needs import needs_plugin

DATA = Path(os.environ.get("DAMAGEEST_REAL_DATA", "")) / "cad"
pytestmark = [
    needs_plugin("cadquery"),
    pytest.mark.skipif(not DATA.is_dir(), reason="DAMAGEEST_REAL_DATA names no folder with a folder cad"),
]
STOCK = 0.3


@dataclass(frozen=True)
class Case:
    """The middle of the longest sharp edge, and the diagonal, in millimetres. ``narrow``: whether solids of it are
    nearer to each other than stock is high, so that there is no deposit."""

    centre: tuple[float, float, float]
    diagonal: float
    narrow: bool = False


CASES = {
    "CrankArm.brep": Case((44.921, -20.412, -104.1), 175.016),
    "component8.step": Case((11.0, 188.5, 0.0), 65.464),
    "frame.step": Case((304.8, 0.0, 203.2), 1118.889),
    "linkrods.step": Case((3.358, 3.25, 0.0), 5.727),
    "screw.step": Case((-22.898, -0.826, 0.436), 50.886),
    "Motor-c.brep": Case((-34.0, 0.0, -1.5), 297.305),
    # a fillet touches a bore along a circle: between them is a gap that closes to nothing
    "Axis_of_bearing.brep": Case((-42.545, -78.741, 0.0), 142.345, narrow=True),
}
QUICK: tuple[str, ...] = ()


@pytest.mark.variants(slow=2)
@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=() if name in QUICK else pytest.mark.slow) for name in CASES]
)
def test_damage_and_deposit_are_read_back_as_they_are(name: str, tmp_path: Path) -> None:
    case, out = CASES[name], tmp_path / "out"
    error = damageest.run(write_job(name, case), output=out).part.tessellation_error
    (site,) = json.loads((out / "result.json").read_text())["sites"]
    exact = site["exact"]
    assert exact["form"] != "none", exact["tried"]
    lost, curved = measure_file(out / "damage/site-1.step", 0.003 / 16 * case.diagonal)
    assert abs(lost - site["volume"]) <= 3e-3 * site["volume"] + error * curved, (
        "beside the chords of the part's triangles"
    )
    if case.narrow:
        assert (site["deposit"], exact["deposit"]) == (None, None)
        assert "no room for the stock" in (out / "result.json").read_text()
        assert not (out / "deposit/site-1.step").exists()
        return
    built, _ = measure_file(out / "deposit/site-1.step", 0.003 / 16 * case.diagonal)
    mesh = site["deposit"]["volume"]
    assert exact["deposit"]["reason"] == ""
    assert exact["deposit"]["offsets"] > 0
    assert built == pytest.approx(mesh, rel=0.02), "the mesh's outline is drawn out"


def write_job(name: str, case: Case) -> dict[str, object]:
    ball = {"tool": "sphere", "centre": list(case.centre), "radius": case.diagonal / 14}
    return {
        "version": 1, "units": "mm", "tolerance": 0.003 * case.diagonal, "part": str(DATA / name), "align": "none",
        "scan": {
            "use": "simulate", "points": 40000, "noise": 0.00075 * case.diagonal, "seed": 3, "damage": [ball],
        },
        "allowance": {"use": "milling", "outer": STOCK},
        "export": {"format": ["step"], "solids": "exact"}, "report": "none", "accept": "all",
    }  # fmt: skip


def measure_file(path: Path, chord: float) -> tuple[float, float]:
    """The volume of a STEP file's solids, by triangles, and the area of their curved faces that are the part's; all
    solids are valid and closed, and their faces have names."""
    from damageest_cadquery.reading.list_faces import list_faces
    from damageest_cadquery.reading.read import explore, read
    from damageest_cadquery.solids.split import triangulate
    from OCP.BRep import BRep_Tool
    from OCP.BRepCheck import BRepCheck_Analyzer
    from OCP.TopAbs import TopAbs_SHELL
    from OCP.TopoDS import TopoDS

    found = read(path, ".step")
    assert found.solids
    assert all(BRepCheck_Analyzer(solid).IsValid() for solid in found.solids)
    shells = [TopoDS.Shell_s(shell) for solid in found.solids for shell in explore(solid, TopAbs_SHELL)]
    assert all(BRep_Tool.IsClosed_s(shell) for shell in shells)
    faces = list_faces(found, 1.0)
    assert all(face.name for face in faces)
    curved = sum(face.area for face in faces if face.kind != "plane" and " inner " not in face.name)
    return sum(triangulate(solid, chord).volume for solid in found.solids), curved
