"""Stage `adapt: none`."""

from __future__ import annotations

from damageest.result import Result
from damageest.stages.adapt.none import NoAdapt as NoAdapt


def test_is_the_default_and_leaves_no_trace(small_result: Result) -> None:
    assert small_result.adapted is None
    assert "adapt" not in [record.stage for record in small_result.stages]
    assert NoAdapt().run() is None
