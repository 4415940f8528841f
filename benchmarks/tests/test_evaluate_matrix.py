"""The matrix: every implementation on a job, with the truth, or why not; in a page that asks for it."""

from __future__ import annotations

import re
from math import nan
from pathlib import Path

import numpy as np
import pytest
import trimesh
from damageest_benchmarks.matrix import DEFAULT, MatrixCell, run_matrix
from damageest_benchmarks.matrix_job import prepare_matrix_job
from damageest_benchmarks.readme import make_marks, make_matrix_table, replace_between_marks

from damageest.artefacts import Solid
from damageest.errors import InputError, JobError
from damageest.registry import Registry
from damageest.registry.contracts import STAGES
from tests import damaged_box
from tests.needs import PLUGINS, needs_plugin

BEGIN, END = make_marks("matrix")
PAGE = Path(__file__).parents[2] / "benchmarks" / "results" / "damages.md"
JOB = """\
version: 1
tolerance: 0.2
part: box.stl
scan:
  use: simulate
  points: 20000
  noise: 0.04
  pose: random
  damage:
    - {tool: sphere, centre: [0, 0, 10], radius: 6}
"""


@pytest.fixture
def job(tmp_path: Path) -> Path:
    trimesh.creation.box(damaged_box.SIZE).export(tmp_path / "box.stl")
    (tmp_path / "box.yaml").write_text(JOB)
    return tmp_path / "box.yaml"


@pytest.mark.slow
def test_every_implementation_of_a_stage_is_run(job: Path, registry: Registry) -> None:
    told: list[MatrixCell] = []
    cells = run_matrix([job], registry, ["boundary", "align", "export"], workers=2, tell=told.append)
    assert [(cell.stage, cell.use) for cell in cells] == [("", DEFAULT)] + [
        (stage, item.name) for stage in ("align", "boundary", "export") for item in registry.of(stage)
    ]
    assert told == cells
    for cell in cells:
        assert not cell.refused
        assert cell.iou > 0.97
        assert 0 <= cell.stage_seconds < cell.seconds
        assert 50 < cell.megabytes < 5000


def test_a_refusal_is_shown_with_its_reason() -> None:
    reason = "reconstruct: pyvista (5 points near (1, 2, 3)): at least 16 points are needed"
    cells = [MatrixCell("repair", "none", "box", iou, refused=text) for iou, text in ((0.981, reason), (nan, reason))]
    text = make_matrix_table([cells[0]])
    assert re.search(r"\| repair \| none \| 0\.981, partly refused \[1\] \|", text)
    assert re.search(r"^1\. .*points.* are needed", text, re.MULTILINE)
    assert re.search(r"\| repair \| none \| refused \[1\] \|", make_matrix_table([cells[1]]))


@pytest.mark.slow
def test_a_jobs_own_result_stands_for_a_truth_that_is_not_known(tmp_path: Path, registry: Registry) -> None:
    scene = prepare_matrix_job(damaged_box.write_least(tmp_path), registry, tmp_path / "scene")
    assert scene.name == "job*"
    data = np.load(scene.folder / "scene.npz")
    assert Solid(data["lost"], data["lost_faces"]).volume == pytest.approx(damaged_box.TRUE_VOLUME, rel=0.1)


def test_an_unknown_stage_is_refused(tmp_path: Path, registry: Registry) -> None:
    with pytest.raises(JobError, match="no stage 'grind'"):
        run_matrix([damaged_box.write(tmp_path)], registry, ["grind"])


def test_the_table_goes_between_the_marks_and_nowhere_else(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text(f"before\n{BEGIN}\nold\n{END}\nafter\n")
    assert replace_between_marks(page, "new", "matrix") == f"before\n{BEGIN}\n\nnew\n\n{END}\nafter\n"
    page.write_text("no marks\n")
    with pytest.raises(InputError, match="matrix: begin"):
        replace_between_marks(page, "new", "matrix")


@needs_plugin(*PLUGINS)
def test_the_matrix_in_the_docs_has_every_implementation(registry: Registry) -> None:
    text = PAGE.read_text().partition(BEGIN)[2].partition(END)[0]
    rows = [[word.strip() for word in line.strip("|").split("|")] for line in text.splitlines() if line.startswith("|")]
    head, rule, *body = rows
    assert head[:2] == ["stage", "implementation"]
    assert set(rule[2:]) == {"---:"}
    stage, listed = "", set()
    for row in body:
        assert len(row) == len(head)
        stage = row[0] or stage
        listed.add((stage, row[1]))
        for value in row[2:-3]:
            assert re.fullmatch(r"[01]\.\d{3}(, partly refused \[\d+\]| \(flagged\))?|refused \[\d+\]", value)
    shipped = ("damageest", "damageest-")
    there = {(s, i.name) for s in STAGES for i in registry.of(s) if i.provider.name.startswith(shipped)}
    assert there <= listed
    assert listed <= {(s, i.name) for s in STAGES for i in registry.of(s)}, "names what is not there"
