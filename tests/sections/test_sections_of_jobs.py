"""`sections` in a job: what is checked, and what result.json, the tables, the drawings and the report have of them."""

from __future__ import annotations

import csv
import io
import json
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest

import damageest
from damageest.errors import JobError
from damageest.job import load
from damageest.registry import Registry
from tests import damaged_box

DEPTH = 6.0
"""mm of the half ball in the top of the box."""
SECTIONS = """
sections:
  - {y: 0, name: middle}
  - {along: z, count: 3}
  - {z: 99}
  - {line: {from: [-15, 0, 10], to: [15, 0, 10]}}
"""


@pytest.fixture(scope="module")
def ran(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("sections")
    job = damaged_box.write(
        folder, damaged_box.JOB.replace("report: none\n", "").replace("0.2", "0.4") + SECTIONS, 6000
    )
    damageest.run(job, output=folder / "out")
    return folder / "out"


def test_result_json_and_the_tables_have_the_sections(ran: Path) -> None:
    found = json.loads((ran / "result.json").read_text())["sections"]
    assert [section["name"] for section in found] == ["middle", "z = -5", "z = 0", "z = 5", "z = 99", "line"]
    deepest = {v["name"]: v for v in found[0]["values"]}["deepest"]
    assert deepest["measured"] == pytest.approx(-DEPTH, abs=0.4)
    assert found[4]["kind"] == "none"
    assert not found[4]["values"]
    rows = list(csv.DictReader(io.StringIO((ran / "sections/sections.csv").read_text())))
    (row,) = [row for row in rows if row["name"] == "middle" and row["quantity"] == "deepest"]
    assert float(row["measured"]) == pytest.approx(deepest["measured"], rel=1e-4)
    stations = list(csv.DictReader(io.StringIO((ran / "sections/section-6.csv").read_text())))
    assert min(float(each["deviation, mm"] or 0) for each in stations) == pytest.approx(-DEPTH, abs=0.4)
    assert set(found[0]["files"]) == {"sections/section-1.csv", "sections/section-1.svg"}


def test_drawings_are_svg_and_stand_in_the_report(ran: Path) -> None:
    drawing = ET.parse(ran / "sections/section-1.svg").getroot()
    kinds = {each.get("class") for each in drawing}
    assert {"metal", "nominal", "below", "within", "ruler"} <= kinds
    page = (ran / "report.html").read_text()
    assert '<section id="sections">' in page
    assert "it passes beside the part" in page


def test_a_job_as_it_ran_asks_for_the_same_sections(ran: Path) -> None:
    again = load(ran / "job.yaml", Registry.discover())
    assert [one.model_dump(exclude_defaults=True) for one in again.sections][1] == {"along": "z", "count": 3}
    assert again.sections[3].line is not None
    assert again.sections[3].line.end == (15, 0, 10)


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        ("{x: 1, z: 2}", "give one of x, y, z, plane, along, line; this has x and z"),
        ("{count: 3, kind: blade}", "this has none"),
        ("{z: 1, count: 3}", "'count' belongs to 'along'"),
        ("{along: [0, 0, 0]}", "a direction must have a length"),
        ("{line: {from: [0, 0, 0], to: [0, 0, 0]}}", "the ends of a line must differ"),
        ("{z: 1, knd: blade}", "unknown key 'knd' (did you mean 'kind'?)"),
    ],
)
def test_what_a_section_cannot_be_is_a_fault_of_the_job(asked: str, said: str, tmp_path: Path) -> None:
    job = damaged_box.write(tmp_path, damaged_box.JOB + f"sections: [{asked}]\n", 60)
    with pytest.raises(JobError) as error:
        load(job, Registry.discover())
    assert said in str(error.value)
