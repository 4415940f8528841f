"""Crops of a scan: what each keeps, in which order, and what is said of it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from pydantic import TypeAdapter, ValidationError

from damageest.artefacts import Scan
from damageest.errors import InputError
from damageest.geometry.crops import AnyCrop, crop_points

CROPS: TypeAdapter[tuple[AnyCrop, ...]] = TypeAdapter(tuple[AnyCrop, ...])


@pytest.fixture(scope="module")
def scan() -> Scan:
    """Even points in a cube from -1 to 1 with normals and two views."""
    points = np.random.default_rng(0).uniform(-1, 1, (20_000, 3))
    return Scan(points, np.tile([0.0, 0, 1], (20_000, 1)), viewpoints=np.eye(3)[:2], view=np.arange(20_000) % 3 - 1)


def crop(scan: Scan, *crops: dict[str, Any]) -> Scan:
    return crop_points(scan, CROPS.validate_python(crops))


@pytest.mark.parametrize(
    ("shape", "share"),
    [
        ({"keep": "box", "min": (-1, -1, -1), "max": (0, 0, 1)}, 1 / 4),
        ({"drop": "box", "min": (-1, -1, -1), "max": (0, 0, 1)}, 3 / 4),
        ({"keep": "cylinder", "point": (0, 0, -1), "axis": (0, 0, 3), "radius": 1, "length": 1}, np.pi / 8),
        ({"drop": "cylinder", "point": (0, 0, -1), "axis": (0, 0, 3), "radius": 1, "length": 2}, 1 - np.pi / 4),
        ({"keep": "above", "point": (0, 0, 0.5), "normal": (0, 0, 2)}, 1 / 4),
        ({"drop": "above", "point": (0, 0, 0), "normal": (1, 1, 0)}, 1 / 2),
        ({"keep": "above", "point": (9, 9, 0.5)}, 1 / 4),
    ],
)
def test_the_share_that_a_shape_keeps(scan: Scan, shape: dict[str, Any], share: float) -> None:
    left = crop(scan, shape)
    assert len(left.points) / 20_000 == pytest.approx(share, abs=0.015)
    assert f"removed {20_000 - len(left.points)} of 20000 points" in left.notes[-1]


def test_normals_and_views_go_with_their_points(scan: Scan) -> None:
    left = crop(scan, {"keep": "above", "point": (0, 0, 0)})
    kept = scan.points[:, 2] >= 0
    assert scan.view is not None
    assert left.view is not None
    assert left.normals is not None
    assert np.array_equal(left.view, scan.view[kept])
    assert len(left.normals) == len(left.points)
    assert np.array_equal(left.viewpoints, scan.viewpoints)


def test_the_largest_piece() -> None:
    grid = np.stack(np.meshgrid(np.arange(60.0), np.arange(60.0), [0.0]), axis=-1).reshape(-1, 3)
    rng = np.random.default_rng(0)
    grid += rng.normal(scale=0.01, size=grid.shape)
    part, table, stray = grid, grid[:1200] + np.array([0, 0, 30]), rng.uniform(100, 200, (20, 3))
    scan = Scan(np.concatenate([table, part, stray]))
    left = crop(scan, {"keep": "largest piece"})
    assert np.array_equal(left.points, part)
    wide = crop(scan, {"keep": "largest piece", "gap": 40})
    assert len(wide.points) == len(part) + len(table)


def test_crops_are_applied_in_order(scan: Scan) -> None:
    """The piece of what the first leaves, not of the whole."""
    upper = {"keep": "above", "point": (0, 0, 0)}
    box = {"drop": "box", "min": (-0.2, -2, -2), "max": (0.2, 2, 2)}
    piece = {"keep": "largest piece", "gap": 0.25}
    left = crop(scan, upper, box, piece)
    assert len(left.points) == pytest.approx(20_000 * 0.4 / 2, rel=0.05)
    assert [note.split(":")[0] for note in left.notes] == [
        "crop 1 (keep above)", "crop 2 (drop box)", "crop 3 (keep largest piece)",
    ]  # fmt: skip
    assert len(crop(scan, piece, upper).points) == pytest.approx(10_000, rel=0.05)


def test_nothing_left_names_the_crop_and_the_scan(scan: Scan) -> None:
    with pytest.raises(InputError, match=r"crop 2 \(keep box\) leaves no points.* in x, .*-1 to -0.0001"):
        crop(scan, {"drop": "above", "point": (0, 0, 0)}, {"keep": "box", "min": (5, 5, 5), "max": (6, 6, 6)})


@pytest.mark.parametrize(
    ("fault", "says"),
    [
        ({"min": (0, 0, 0), "max": (1, 1, 1)}, "give  keep: box"),
        ({"keep": "sphere"}, "give  keep: box"),
        ({"drop": "largest piece"}, "give  keep: box"),
        ({"keep": "box", "drop": "box", "min": (0, 0, 0), "max": (1, 1, 1)}, "either"),
        ({"keep": "box", "min": (0, 0, 0), "max": (1, 0, 1)}, "min is not below max in y"),
        ({"keep": "above", "point": (0, 0, 0), "normal": (0, 0, 0)}, "must have a length"),
        ({"keep": "cylinder", "point": (0, 0, 0), "axis": (0, 0, 0), "radius": 1, "length": 1}, "must have a length"),
    ],
)
def test_faults_are_named(scan: Scan, fault: dict[str, Any], says: str) -> None:
    with pytest.raises(ValidationError, match=says):
        crop(scan, fault)
