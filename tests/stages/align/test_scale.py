"""A scan of another size is told as such, and damage is not taken for one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from align_scenes import scene

from damageest.artefacts import Pose, Scan
from damageest.errors import StageError
from damageest.stages.align.register import Register


def say(name: str, factor: float, points: int = 4000, keep: float = 1.0) -> str:
    """What the alignment says of a scan of a made part whose lengths are multiplied by a factor. Of the scan the share
    ``keep`` is there."""
    part, scan = scene(name, 60, points=points)
    along = scan.points[:, 0]
    shown = scan.points[along >= np.quantile(along, 1 - keep)]
    scaled = replace(scan, points=factor * shown, noise=factor * scan.noise, spacing=factor * scan.spacing)
    try:
        pose: Pose = Register(trials=20_000).run(Scan(scaled.points, noise=scaled.noise), part, 4 * scan.noise)
    except StageError as refused:
        return str(refused)
    return "; ".join(str(doubt) for doubt in pose.doubts)


@pytest.mark.slow
@pytest.mark.parametrize(("factor", "words"), [(0.95, "5.0 % smaller"), (1.1, "10 % larger"), (0.6, "40 % smaller")])
def test_a_scan_of_another_size_is_named(factor: float, words: str) -> None:
    said = say("lever", factor)
    assert "the scale is wrong" in said
    told = float(said.split("the scan is ")[1].split(" %")[0])
    assert told == pytest.approx(float(words.split()[0]), abs=0.2)
    assert words.split()[2] in said


@pytest.mark.slow
@pytest.mark.parametrize("name", ["block", "lever", "tube"])
def test_two_thirds_of_a_scan_show_its_size_too(name: str) -> None:
    assert "the scale is wrong" in say(name, 1.05, keep=0.67)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["block", "lever", "blade", "tube"])
def test_a_scan_of_the_right_size_is_not_questioned(name: str) -> None:
    assert "scale" not in say(name, 1.0)
