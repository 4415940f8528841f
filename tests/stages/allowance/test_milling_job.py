"""Options of `allowance: milling` as a job file gives them: faults by line and column, files beside the job."""

from __future__ import annotations

from pathlib import Path

import pytest

from damageest.errors import JobError
from damageest.job import load, yamlfile
from damageest.job.schema import job_schema
from damageest.registry import Registry
from damageest.stages.allowance import Allowance
from damageest.stages.allowance.milling import Milling
from tests import damaged_box
from tests.needs import import_or_skip

VALID = """
allowance:
  use: milling
  outer: 0.5
  targets:
    - {facing: {direction: [0, 0, 1], angle: 20}, outer: 0}
    - box: [[0, 0, 0], [10, 20, 5]]
      outer: 1.2
    - {faces: [3, flank], outer: 0.8}
  keep_out: [{cylinder: {from: [0, 0, -9], to: [0, 0, 9], radius: 4}}, {mesh: box.stl}, {kind: cylinder}]
"""


def write_job(folder: Path, text: str) -> Path:
    return damaged_box.write(folder, damaged_box.JOB + text)


def test_a_valid_job(tmp_path: Path) -> None:
    path = write_job(tmp_path, VALID)
    job = load(path, Registry.discover())
    stage = job.stages[Allowance]
    assert isinstance(stage, Milling)
    assert stage.keep_out[1].mesh == tmp_path / "box.stl"
    jsonschema = import_or_skip("jsonschema")
    schema = jsonschema.Draft202012Validator(job_schema(Registry.discover()))
    schema.validate(yamlfile.read(path)[0])
    schema.validate(job.to_values(tmp_path))
    (tmp_path / "again.yaml").write_text(yamlfile.write(job.to_values(tmp_path)))
    assert load(tmp_path / "again.yaml", Registry.discover()).stages[Allowance] == stage


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("20, 5]]", "oops, 5]]"), r"job.yaml:13:29: allowance.targets.1.box.1.1: .*'oops'"),
        (("- box", "- boxx"), r"job.yaml:13:7: allowance.targets.1: unknown key 'boxx' \(did you mean 'box'\?\)"),
        (("radius: 4", "radius: -4"), r"allowance.keep_out.0.cylinder.radius: .* greater than 0, not -4"),
        (("kind: cylinder", "kind: cone"), r"keep_out.2.kind: expected 'plane', 'cylinder' or 'other', not 'cone'"),
        (("box.stl}", "none.stl}"), r"none.stl: there is no such file"),
        (("outer: 0.8", "outer: -0.8"), r"allowance.targets.2.outer: .* greater than or equal to 0, not -0.8"),
    ],
)
def test_faults_are_reported_with_their_place(tmp_path: Path, change: tuple[str, str], message: str) -> None:
    assert VALID.count(change[0]) == 1
    with pytest.raises(JobError, match=message):
        load(write_job(tmp_path, VALID.replace(*change)), Registry.discover())
