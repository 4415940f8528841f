"""From a job file to checked G-code, and a few deposits of the evaluation. Slow."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
from damageest_benchmarks.paths.run import evaluate_scene
from damageest_benchmarks.paths.scenes import Scene
from damageest_benchmarks.paths.tight import TIGHT
from typer.testing import CliRunner

from damageest.cli import app
from damageest.geometry.solids import to_solid

JOBS = Path(__file__).parents[2] / "jobs"


@pytest.mark.slow
def test_the_example_job_gives_code_that_follows_the_passes(tmp_path: Path) -> None:
    done = CliRunner().invoke(app, ["run", str(JOBS / "block_path.yaml"), "--output", str(tmp_path)])
    assert done.exit_code == 0, done.output
    (result,) = tmp_path.rglob("result.json")
    (site,) = json.loads(result.read_text())["sites"]
    assert site["path"]["fill"]["filled"] > 0.99
    (code,) = tmp_path.rglob("site-1.ngc")
    (table,) = tmp_path.rglob("site-1.csv")
    rows = np.genfromtxt(table, delimiter=",", names=True)
    moves = [line for line in code.read_text().splitlines() if re.search(r"\bG0?[01]\b.*[XYZ]", line)]
    places = []
    at: dict[str, float] = {}
    for line in moves:
        at |= {word: float(value) for word, value in re.findall(r"([XYZ])(-?[\d.]+)", line)}
        places.append([at.get(word, np.nan) for word in "XYZ"])
    ends = np.column_stack([rows["x"], rows["y"], rows["z"]])
    assert len(places) >= len(ends)
    far = np.linalg.norm(np.array(places)[:, None] - ends[None], axis=2)
    assert np.ptp(np.nanmin(far, axis=0)) < 0.01


@pytest.mark.variants(slow=1)
@pytest.mark.slow
@pytest.mark.parametrize("kind", ["wall", "ledge", "inner"])
def test_five_axes_reach_tight_places(kind: str) -> None:
    part, tool = TIGHT[kind](np.random.default_rng([4712, 0, len(kind)]))
    body, left = to_solid(part ^ tool), to_solid(part - tool)
    assert body is not None
    assert left is not None
    scene = Scene(kind, kind, body, left)
    assert evaluate_scene(scene, 3).unreached > 0.5
    row = evaluate_scene(scene, 5)
    # where the deposit runs out, it is thinner than a bead: that is counted apart
    thin = sum(share for why, share in row.why.items() if "so thin over intact metal" in why)
    assert row.unreached - thin < 0.02
    assert row.unreached < 0.07
    assert row.filled > 0.99
    assert row.spill <= 1.1
    assert row.shaded == 0
    assert min(row.gap, row.built) >= 0.75 * row.claimed > 0
    assert row.crossings == 0
