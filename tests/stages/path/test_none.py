"""No path."""

from __future__ import annotations

from damageest.stages.path.none import NoPath


def test_gives_nothing() -> None:
    assert NoPath().run() is None
