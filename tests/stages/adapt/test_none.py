"""Stage `adapt: none`."""

from __future__ import annotations

from pathlib import Path

import damageest
from damageest.stages.adapt.none import NoAdapt as NoAdapt
from tests import damaged_box


def test_is_the_default_and_leaves_no_trace(tmp_path: Path) -> None:
    result = damageest.run(damaged_box.write(tmp_path))
    assert result.adapted is None
    assert "adapt" not in [record.stage for record in result.stages]
    assert NoAdapt().run() is None
