"""A folder with a part and a scan of it, for the tests of the page."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from app_page import Page
from ruamel.yaml import YAML

CORNER = (20, -15, 6)


def write_plate(folder: Path, factor: float = 1.0, damages: Sequence[Any] = (CORNER,), move: Any = None) -> None:
    """A block with a boss, and points on it; a ball is missing at each of the ``damages``. ``move`` (4,4): a motion of
    the scan; ``factor``: of its lengths."""
    part = trimesh.creation.box((40, 30, 12))
    boss = trimesh.creation.cylinder(
        5, 8, sections=48, transform=trimesh.transformations.translation_matrix((-9, 5, 8))
    )
    part = trimesh.boolean.union([part, boss], engine="manifold")
    part.export(folder / "plate.stl")
    sample(folder, part, damages, factor, move)


def sample(folder: Path, part: Any, damages: Sequence[Any], factor: float = 1.0, move: Any = None) -> None:
    """A scan of a damaged part, with the noise of a sensor."""
    for place in damages:
        ball = trimesh.creation.icosphere(3, 9)
        ball.apply_translation(place)
        part = trimesh.boolean.difference([part, ball], engine="manifold")
    points = part.sample(30_000, seed=1)
    points += np.random.default_rng(0).normal(0, 0.02, points.shape)
    if move is not None:
        points = trimesh.transform_points(points, move)
    np.savetxt(folder / "scan.xyz", points * factor, fmt="%.5f")


def make_job(page: Page, part: str = "plate.stl", scan: str = "scan.xyz") -> None:
    """Picks part and scan, and opens them."""
    page.choose("part", part)
    page.choose("scan", scan)
    page.click("make")


def open_job(page: Page, part: str = "plate.stl", scan: str = "scan.xyz") -> None:
    """The same, and waits until they are there."""
    make_job(page, part, scan)
    page.wait("part-facts", "mm", 60)
    page.at_rest()


def read_job(folder: Path) -> Any:
    return YAML(typ="safe").load((folder / "plate.yaml").read_text())
