"""Every implementation that a job may name for a stage of `method: surface` finds the same damage."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

import damageest
from damageest.job import yamlfile
from damageest.registry import Registry
from tests import damaged_box
from tests.needs import needs_plugin

JOB = Path(__file__).parents[2] / "jobs" / "named_stages.yaml"
STAGES = ("method", "reconstruct", "background", "enclose", "repair", "boolean")
BED = {"use": "build_volume", "corner": [-40, -40, -40], "size": [80, 80, 80]}
CHOICES = [
    ("repair", "pymeshfix", "pymeshfix"), ("reconstruct", "signed_distance", ""), ("background", "capsule", ""),
    ("background", BED, ""),
]  # fmt: skip
"""What is replaced, by what, and the plugin that it needs; the rest is as the example names it."""
SLOW = [
    ("reconstruct", "ball_pivot", "open3d"), ("reconstruct", "pymeshlab", "pymeshlab"), ("background", "cylinder", ""),
    ("background", "offset", ""), ("background", "minkowski", ""), ("boolean", "pymeshlab", "pymeshlab"),
]  # fmt: skip


def mark_choice(stage: str, use: object, plugin: str, *marks: pytest.MarkDecorator) -> Any:
    marks = (*marks, needs_plugin(plugin)) if plugin else marks
    return pytest.param(stage, use, marks=marks, id=f"{stage}-{json.dumps(use)[:12]}")


@pytest.mark.parametrize(
    ("stage", "use"), [*(mark_choice(*one) for one in CHOICES), *(mark_choice(*one, pytest.mark.slow) for one in SLOW)]
)
def test_each_choice_finds_the_damage(stage: str, use: object, small_done: Path, registry: Registry) -> None:
    """The example's stages, one of them replaced, on a small box; repair only where pymeshfix is there."""
    named = yamlfile.read(JOB)[0]
    settings = [f"{name}={json.dumps(named[name])}" for name in STAGES if name not in ("repair", stage)]
    result = damageest.run(
        small_done, settings=[*settings, f"{stage}={json.dumps(use)}", "report=none"], registry=registry, output=True
    )
    assert result.damage_volume == pytest.approx(damaged_box.TRUE_VOLUME, rel=0.04)
    assert [site.verdict.level for site in result.sites] in (["proven"], ["likely"])
    assert not result.failures
