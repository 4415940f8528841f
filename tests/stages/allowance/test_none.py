"""No deposit other than the damage volume."""

from __future__ import annotations

import trimesh

from damageest.artefacts import Solid
from damageest.stages.allowance.none import NoAllowance


def test_gives_nothing() -> None:
    box = trimesh.creation.box((3, 2, 1))
    assert NoAllowance().run(Solid(box.vertices, box.faces)) is None
