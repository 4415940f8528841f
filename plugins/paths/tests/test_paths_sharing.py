"""A region is shared out between ways to hold the tool, of which none is free all over it."""

from __future__ import annotations

import numpy as np
import pytest
from damageest_benchmarks.paths.check import measure_nozzle
from damageest_benchmarks.paths.run import choose_options
from damageest_benchmarks.paths.scenes import make_bore
from damageest_paths.fill.regions import unite_regions
from damageest_paths.fill.sharing import Reached, share_region
from damageest_paths.fill.stripes import Bead, fill_with_rows
from damageest_paths.layers import Layers
from manifold3d import CrossSection

from damageest.artefacts import Floats

BEAD = Bead(1.0, 0.7)
REGION = CrossSection.square((16, 10))


def list_points() -> list[Floats]:
    """Points on the rows that fill the region."""
    rows = fill_with_rows(REGION, BEAD, 0.0, linked=False)
    return [np.linspace(row[0], row[-1], 33) for row in rows]


def test_two_ways_that_overlap_get_half_of_it_each() -> None:
    lines = [Reached(line, np.column_stack([line[:, 0] < 12, line[:, 0] > 4])) for line in list_points()]
    parts = share_region(REGION, lines, BEAD)
    assert [part.area() for part in parts] == pytest.approx([80, 80], abs=8)
    assert (REGION - unite_regions(parts)).area() < 0.01 * REGION.area()
    # as near as beads are to each other
    assert 0 < (parts[0] ^ parts[1]).area() < 10 * BEAD.width


def test_what_no_way_serves_belongs_to_no_part() -> None:
    lines = [Reached(line, (line[:, :1] < 6) | (line[:, :1] > 15.7)) for line in list_points()]
    (part,) = share_region(REGION, lines, BEAD)
    assert part.bounds()[2] < 7, "a strip that is narrower than a bead is none either"
    nowhere = [Reached(line, np.zeros((len(line), 3), bool)) for line in list_points()]
    assert share_region(REGION, nowhere, BEAD) == []


@pytest.mark.slow
def test_a_long_bore_is_filled_from_both_mouths_with_few_passes() -> None:
    """Each ring of a spiral was two passes, one from either mouth."""
    rng = np.random.default_rng([4711, 1, len("bore")])
    (scene,) = make_bore(rng, "bore 2")
    stage = Layers.model_validate({**choose_options(scene), "axes": 5, "layers": "conformal"})
    path = stage.run(body=scene.body, left=scene.left, built=None, tolerance=0.02 * stage.width)
    assert path is not None
    assert path.passes <= 5 * path.layers
    assert path.unreached_volume < 0.005 * path.deposit_volume
    assert measure_nozzle(path, scene.left, 0.2) > 0
