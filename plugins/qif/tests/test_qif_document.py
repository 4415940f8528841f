"""QIF documents: valid by the standard's schemas, and with the numbers of `result.json`, read back by a parser of these
tests. The schemas (qif_schemas.zip) are those of the QIF community, with their licence."""

from __future__ import annotations

import json
import zipfile
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from damageest_qif.document import write_document
from hypothesis import given, settings
from hypothesis import strategies as st
from lxml import etree

import damageest
from damageest.artefacts import Reason
from damageest.result import Result
from tests.damaged_box import JOB, write

Q = "{http://qifstandards.org/xsd/qif3}"
JOBS = Path(__file__).parents[3] / "jobs"
DATUMS = """align:
  use: icp
  datum:
    A: [{facing: {direction: [0, 0, -1], angle: 5}}]
    B: [{facing: {direction: [0, -1, 0], angle: 5}}]
export: {format: [qif]}
"""


@pytest.fixture(scope="session")
def schema(tmp_path_factory: pytest.TempPathFactory) -> etree.XMLSchema:
    folder = tmp_path_factory.mktemp("qif")
    with zipfile.ZipFile(Path(__file__).parent / "qif_schemas.zip") as archive:
        archive.extractall(folder)
    return etree.XMLSchema(etree.parse(folder / "QIFApplications" / "QIFDocument.xsd"))


def validate(schema: etree.XMLSchema, file: Path) -> list[str]:
    """The faults of a document by the schemas."""
    schema.validate(etree.parse(file))
    return [f"{one.line}: {one.message}" for one in schema.error_log]


def read_attributes(element: ElementTree.Element) -> dict[str, str]:
    return {one.attrib["name"]: one.attrib["value"] for one in element.findall(f"{Q}Attributes/*")}


@cache
def _run(folder: Path, job: str) -> Result:
    return damageest.run(write(folder, job, 8000))


@pytest.fixture(scope="session")
def result(tmp_path_factory: pytest.TempPathFactory) -> Result:
    return _run(tmp_path_factory.mktemp("datums"), JOB.replace("align: none\n", "") + DATUMS)


def test_a_document_is_valid_and_has_the_numbers_of_the_result(
    tmp_path: Path, schema: etree.XMLSchema, result: Result
) -> None:
    write_document(tmp_path, result)
    assert validate(schema, tmp_path / "result.qif") == []
    root = ElementTree.parse(tmp_path / "result.qif").getroot()
    (site,) = result.sites
    (measured,) = root.iter(f"{Q}OtherSurfaceFeatureMeasurement")
    told = read_attributes(measured)
    assert float(told["volume"]) == pytest.approx(site.damage.volume, rel=1e-12)
    assert told["verdict"] == site.verdict.level
    assert site.volume_95 is not None
    assert float(told["volume_95_high"]) == pytest.approx(site.volume_95[1])
    (points,) = root.iter(f"{Q}MeasuredPointSet")
    vertices = np.array((points.findtext(f"{Q}Points") or "").split(), float).reshape(-1, 3)
    faces = np.array((points.findtext(f"{Q}PointIndices") or "").split(), int).reshape(-1, 3)
    assert np.array_equal(vertices, site.surface.vertices)
    assert np.array_equal(faces, site.surface.faces)
    assert int(points.attrib["count"]) == len(vertices)
    (depth,) = root.iter(f"{Q}UserDefinedLinearCharacteristicMeasurement")
    value = depth.find(f"{Q}Value")
    assert value is not None
    assert float(value.text or 0) == site.max_depth
    low, high = site.depth_95 or (0.0, 0.0)
    assert float(value.attrib["combinedUncertainty"]) == pytest.approx((high - low) / 4)


def test_datums_are_features_in_their_order(tmp_path: Path, result: Result) -> None:
    write_document(tmp_path, result)
    root = ElementTree.parse(tmp_path / "result.qif").getroot()
    labels = {one.attrib["id"]: one.findtext(f"{Q}DatumLabel") for one in root.iter(f"{Q}DatumDefinition")}
    frame = root.find(f"{Q}DatumReferenceFrames/{Q}DatumReferenceFrame")
    assert frame is not None
    used = [
        (labels[one.findtext(f"{Q}SimpleDatum/{Q}DatumDefinitionId") or ""], one.findtext(f"{Q}Precedence/*"))
        for one in frame.findall(f"{Q}Datums/{Q}Datum")
    ]
    assert used == [("A", "PRIMARY"), ("B", "SECONDARY")]
    assert "shift along (1.00" in read_attributes(frame)["left_free"]
    normals = [one.findtext(f"{Q}Normal") for one in root.iter(f"{Q}PlaneFeatureNominal")]
    assert normals == ["0 0 -1", "0 -1 0"]


def test_numbers_of_elements_are_unique_and_counted(tmp_path: Path, result: Result) -> None:
    write_document(tmp_path, result)
    root = ElementTree.parse(tmp_path / "result.qif").getroot()
    numbers = [int(one.attrib["id"]) for one in root.iter() if "id" in one.attrib]
    assert sorted(numbers) == list(range(1, int(root.attrib["idMax"]) + 1))


def test_the_same_result_gives_the_same_bytes(tmp_path: Path, result: Result) -> None:
    files = []
    for name in ("one", "two"):
        (tmp_path / name).mkdir()
        write_document(tmp_path / name, result)
        files.append((tmp_path / name / "result.qif").read_bytes())
    assert files[0] == files[1]


def change(result: Result, kind: str) -> Result:
    """Results of other kinds."""
    site = result.sites[0]
    doubtful = replace(site, accepted=False, verdict=replace(site.verdict, level="doubtful"), uncertainty=None)
    return {
        "nothing found": lambda: replace(result, sites=(), damage=None),
        "doubtful": lambda: replace(result, sites=(doubtful,), damage=None, volume_95=None),
        "incomplete": lambda: replace(result, failures=("site 2 has no volume: <&>\x07",)),
        "inches": lambda: replace(result, units="in"),
        "open interval": lambda: replace(result, volume_95=(1.0, np.inf)),
        "no datums": lambda: replace(result, pose=replace(result.pose, datums=(), left=(), spread=None)),
        "named faces": lambda: replace(result, part=_name_faces(result)),
    }[kind]()


def _name_faces(result: Result) -> Any:
    faces = np.arange(len(result.part.faces))
    return replace(result.part, faces_brep=faces, face_names=("foot & <top>",) * len(faces))


@pytest.mark.parametrize(
    "kind", ["nothing found", "doubtful", "incomplete", "inches", "open interval", "no datums", "named faces"]
)
def test_each_kind_of_result_is_valid(tmp_path: Path, schema: etree.XMLSchema, result: Result, kind: str) -> None:
    write_document(tmp_path, change(result, kind))
    assert validate(schema, tmp_path / "result.qif") == []
    root = ElementTree.parse(tmp_path / "result.qif").getroot()
    status = root.findtext(f".//{Q}MeasurementResults/{Q}InspectionStatus/*")
    assert status == {"nothing found": "PASS", "doubtful": "UNKNOWN", "incomplete": "UNKNOWN"}.get(kind, "FAIL")
    if kind == "named faces":
        assert "foot & <top>" in [one.findtext(f"{Q}Name") for one in root.iter(f"{Q}Entity")]


@settings(max_examples=10, deadline=None)
@given(text=st.text(max_size=30))
def test_any_text_is_written(tmp_path_factory: pytest.TempPathFactory, result: Result, text: str) -> None:
    folder = tmp_path_factory.mktemp("text")
    without = replace(result, sites=(), damage=None)  # that is written in less time
    write_document(folder, replace(without, name=text, warnings=(Reason("align", text),)))
    etree.parse(folder / "result.qif")


@pytest.mark.slow
def test_a_job_writes_it_without_solids(small_done: Path, schema: etree.XMLSchema) -> None:
    small_done.write_text(small_done.read_text() + "export: {format: [qif]}\n")
    out = small_done.parent / "out" / "job"
    from typer.testing import CliRunner

    from damageest.cli import app

    ran = CliRunner().invoke(app, ["run", str(small_done), "-o", str(out)])
    assert ran.exit_code == 0, ran.output
    assert validate(schema, out / "result.qif") == []
    files = json.loads((out / "result.json").read_text())["export"]["files"]
    assert "result.qif" in files
    assert not [name for name in files if name.endswith(".stl")]


@pytest.mark.variants(slow=1)
@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(path.stem for path in JOBS.glob("*.yaml")))
def test_every_example_job_is_valid(tmp_path: Path, schema: etree.XMLSchema, name: str) -> None:
    write_document(tmp_path, damageest.run(JOBS / f"{name}.yaml"))
    assert validate(schema, tmp_path / "result.qif") == []


def test_a_cylinder_has_its_diameter(tmp_path: Path, schema: etree.XMLSchema, result: Result) -> None:
    datum = replace(
        result.pose.datums[0], kind="cylinder and cone", shapes=("cylinder", "cone"), places=((0.0, 0.0, 1e-20),) * 2,
        axes=((0.0, 0.0, 1.0),) * 2, bores=(True, False), nominal=(5.0,), measured=(5.02,),
    )  # fmt: skip
    write_document(tmp_path, replace(result, pose=replace(result.pose, datums=(datum,))))
    assert validate(schema, tmp_path / "result.qif") == []
    root = ElementTree.parse(tmp_path / "result.qif").getroot()
    assert [one.findtext(f"{Q}Diameter") for one in root.iter(f"{Q}CylinderFeatureMeasurement")] == ["10.04"]
