"""Table, clamps that touch the part, and marker dots in the scan: they are named in one line, and the loss is right."""

from __future__ import annotations

from typing import Any

import pytest

import damageest
from tests import damaged_box

LOSS = {"tool": "sphere", "centre": [6, 3, 10], "radius": 6}
CLAMPS = [
    {"tool": "box", "centre": [-27, 0, 11.5], "size": [20, 8, 3]},
    {"tool": "box", "centre": [30, 0, -4], "size": [20, 8, 12]},
]
DOTS = [
    {"tool": "cylinder", "point": [x, y, 9.9], "axis": [0, 0, 1], "length": 0.2, "radius": 2}  # 0.1 mm thick
    for x, y in ((-10, -10), (12, -11), (-6, 11))
]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("scene", "seed"),
    [({}, 2), ({"surroundings": CLAMPS, "added": DOTS}, 0)],
    ids=["table", "table, clamps and dots"],
)
def test_the_loss_is_right_beside_fixtures(scene: dict[str, Any], seed: int) -> None:
    scan: dict[str, Any] = {"use": "simulate", "damage": [LOSS], "points": 90_000, "noise": 0.04, "scanners": 12}
    scan |= {"pose": "random", "seed": seed, "table": {"direction": [0, 0, -1]}, **scene}
    if not scene:
        scan["points"] = 60_000
    job = {"version": 1, "tolerance": 0.25, "report": "none", "scan": scan}
    done = damageest.run(job, part=damaged_box.box())
    assert done.scan.truth is not None
    assert done.scan.truth.damage is not None
    lost = done.scan.truth.damage.volume
    assert done.damage_volume == pytest.approx(lost, rel=0.01)
    (site,) = done.sites
    assert site.verdict.level == "proven"
    assert site.volume_95 is not None
    assert 0.9 * lost < site.volume_95[0] < lost < site.volume_95[1] < 1.1 * lost
    assert {item.kind for item in done.surplus} == {"surroundings"}
    (told,) = (one for one in done.warnings if one.code == "surroundings")
    assert "crop" in told.remedy
    assert done.fit is None or done.fit.model in ("ok", "wavy"), "no bend is found in a box beside a table"
