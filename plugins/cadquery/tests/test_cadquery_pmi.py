"""Datums and tolerances of STEP AP242 files: what is read, compared with files of others, and what is missing."""

from __future__ import annotations

import os
import re
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from damageest_cadquery.brep import Brep
from damageest_cadquery.reading._part21 import Ref, Typed, read_entities
from hypothesis import given
from hypothesis import strategies as st
from typer.testing import CliRunner

from damageest.cli import app
from damageest.io.meshes import write_points
from damageest.job import yamlfile
from damageest.stages.part import CadFace
from tests.needs import import_for, needs_plugin

pytestmark = needs_plugin("cadquery")
cq = import_for("cadquery", "cadquery")

REAL = Path(os.environ.get("DAMAGEEST_REAL_DATA", "/nowhere"))
CTC = REAL / "nist_ctc_01_asme1_ap242-e1.stp"
CTC_QIF = REAL.parent / "qif" / "samples" / "NISTmodels" / "nist_ctc_01_asme1_ap242.qif"
Q = "{http://qifstandards.org/xsd/qif3}"
PMI = """#9001=DATUM_FEATURE('Simple Datum.1',$,#9900,.T.);
#9002=DATUM('',$,#9900,.F.,'A');
#9003=SHAPE_ASPECT_RELATIONSHIP('',$,#9001,#9002);
#9004=GEOMETRIC_ITEM_SPECIFIC_USAGE('','DATUM',#9001,#9901,{bottom});
#9005=DATUM_FEATURE('side; of ''it''',$,#9900,.T.);
#9006=DATUM('',$,#9900,.F.,'B');
#9007=SHAPE_ASPECT_RELATIONSHIP('',$,#9005,#9006);
#9008=ITEM_IDENTIFIED_REPRESENTATION_USAGE('',$,#9005,#9901,SET_REPRESENTATION_ITEM(({side})));
#9010=DATUM_REFERENCE_COMPARTMENT('',$,#9900,.F.,#9002,$);
#9011=DATUM_REFERENCE_COMPARTMENT('',$,#9900,.F.,#9006,$);
#9012=DATUM_SYSTEM('',$,#9900,.F.,(#9010,#9011));
#9013=(LENGTH_MEASURE_WITH_UNIT()MEASURE_REPRESENTATION_ITEM()MEASURE_WITH_UNIT(LENGTH_MEASURE(0.6),#9902)
REPRESENTATION_ITEM(''));
#9014=SHAPE_ASPECT('','GDT',#9900,.T.);
#9015=GEOMETRIC_ITEM_SPECIFIC_USAGE('','GDT',#9014,#9901,{top});
#9016=(GEOMETRIC_TOLERANCE('Profile.1','',#9013,#9014)GEOMETRIC_TOLERANCE_WITH_DATUM_REFERENCE((#9012))
SURFACE_PROFILE_TOLERANCE());
#9900=PRODUCT_DEFINITION_SHAPE('','',$);
#9901=SHAPE_REPRESENTATION('',(),$);
#9902=NAMED_UNIT(*);
"""


def write_part(folder: Path, pmi: str = PMI) -> Path:
    """A box of 40 x 30 x 20 mm as STEP, with PMI as text."""
    path = folder / "box.step"
    cq.exporters.export(cq.Workplane().box(40, 30, 20), str(path))
    text = path.read_text()
    entities = re.findall(r"#(\d+)\s*=\s*ADVANCED_FACE", text)
    faces = Brep(path=path).cad_faces("mm")
    place = {name: find_face(faces, normal) for name, normal in NORMALS.items()}
    filled = pmi.format(**{name: f"#{entities[number]}" for name, number in place.items()})
    head, sep, tail = text.rpartition("ENDSEC;")
    path.write_text(head + filled + sep + tail)
    return path


NORMALS = {"bottom": (0, 0, -1), "side": (0, -1, 0), "top": (0, 0, 1)}


def find_face(faces: tuple[CadFace, ...], normal: tuple[float, ...]) -> int:
    return next(one.number for one in faces if np.allclose(one.normal or (), normal))


def test_datums_systems_and_tolerances_with_their_faces(tmp_path: Path) -> None:
    path = write_part(tmp_path)
    reader = Brep(path=path)
    faces, found = reader.cad_faces("mm"), reader.cad_pmi("mm")
    assert {one.name: one.faces for one in found.datums} == {
        "A": (find_face(faces, NORMALS["bottom"]),),
        "B": (find_face(faces, NORMALS["side"]),),
    }
    assert found.systems == (("A", "B"),)
    (tolerance,) = found.tolerances
    assert (tolerance.kind, tolerance.value, tolerance.datums) == ("surface_profile", 0.6, ("A", "B"))
    assert tolerance.faces == (find_face(faces, NORMALS["top"]),)
    assert found.notes == ()
    (in_inches,) = Brep(path=path).cad_pmi("in").tolerances
    assert in_inches.value == pytest.approx(0.6 / 25.4)


@pytest.mark.parametrize(
    ("pmi", "said"),
    [
        ("", "no datums and no tolerances"),
        ("#9001=DRAUGHTING_CALLOUT('',());\n", "as drawings only"),
        (PMI.replace("{side}", "#987654"), "references of datums and tolerances have no target"),
        (PMI.replace("{side}", "#987654"), "datum B: no CAD face"),
        (PMI.replace("MEASURE_WITH_UNIT(LENGTH_MEASURE(0.6),#9902)", ""), "its amount could not be read"),
        (PMI.replace("#9003=SHAPE_ASPECT_RELATIONSHIP('',$,#9001,#9002);", ""), "datum A: no CAD face"),
    ],
)
def test_what_is_missing_is_said(tmp_path: Path, pmi: str, said: str) -> None:
    assert any(said in note for note in Brep(path=write_part(tmp_path, pmi)).cad_pmi("mm").notes)


@pytest.mark.slow
def test_part_prints_them_and_init_writes_them(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write_part(tmp_path)
    faces = Brep(path=path).cad_faces("mm")
    printed = CliRunner().invoke(app, ["part", str(path)])
    assert printed.exit_code == 0, printed.output
    assert f"datum A: CAD face {find_face(faces, NORMALS['bottom'])}" in printed.output
    assert "surface profile 0.6 mm to A | B" in printed.output
    rng = np.random.default_rng(0)
    points = rng.uniform(-1, 1, (6000, 3)) * (20, 15, 10)
    axis, side = rng.integers(0, 3, 6000), rng.choice([-1, 1], 6000)
    points[np.arange(6000), axis] = side * np.array([20, 15, 10])[axis]
    x, y, z = (points + rng.normal(scale=0.02, size=points.shape)).T
    write_points(tmp_path / "scan.ply", {"x": x, "y": y, "z": z})
    monkeypatch.chdir(tmp_path)
    made = CliRunner().invoke(app, ["init", "box.step", "scan.ply", "--job", "box.yaml"])
    assert made.exit_code == 0, made.output
    job = yamlfile.read(tmp_path / "box.yaml")[0]
    assert job["tolerance"] == 0.3
    assert dict(job["align"]["datum"]) == {
        "A": [find_face(faces, NORMALS["bottom"])],
        "B": [find_face(faces, NORMALS["side"])],
    }


def test_init_without_faces_of_a_datum_says_so(tmp_path: Path) -> None:
    from damageest.cli.init import _write_align
    from damageest.stages.part import CadDatum, CadPmi

    lines = _write_align(CadPmi((CadDatum("A", ()),), (("A",),)), None)
    assert lines[0].startswith("align: register")
    assert "without CAD faces" in lines[1]


@pytest.mark.skipif(not CTC.is_file() or not CTC_QIF.is_file(), reason="DAMAGEEST_REAL_DATA names no such files")
def test_ctc_01_is_as_others_read_it() -> None:
    """All datum features, systems, geometrical tolerances and sizes are those of the QIF file made by others."""
    reader = Brep(path=CTC)
    faces, found = reader.cad_faces("mm"), reader.cad_pmi("mm")
    root = ElementTree.parse(CTC_QIF).getroot()
    features = {one.attrib["id"]: one for one in root.find(f"{Q}Features/{Q}FeatureNominals") or ()}
    letters = {}
    for one in root.iter(f"{Q}DatumDefinition"):
        letters[one.attrib["id"]] = one.findtext(f"{Q}DatumLabel") or ""
        (datum,) = [each for each in found.datums if each.name == letters[one.attrib["id"]]]
        for number in one.findall(f"{Q}FeatureNominalIds/{Q}Id"):
            assert lies_on(features[number.text or ""], [faces[k] for k in datum.faces])
    systems = {
        one.attrib["id"]: tuple(letters[each.text or ""] for each in one.iter(f"{Q}DatumDefinitionId"))
        for one in root.iter(f"{Q}DatumReferenceFrame")
    }
    assert set(found.systems) == set(systems.values())
    nominals = {
        one.findtext(f"{Q}CharacteristicDefinitionId"): one
        for one in root.find(f"{Q}Characteristics/{Q}CharacteristicNominals") or ()
    }
    theirs: list[tuple[str, float, float, tuple[str, ...]]] = []
    ours: list[tuple[str, float, float, tuple[str, ...]]] = []
    for one in root.find(f"{Q}Characteristics/{Q}CharacteristicDefinitions") or ():
        kind = re.sub(r"(?<!^)(?=[A-Z])", "_", one.tag.removeprefix(Q).removesuffix("CharacteristicDefinition")).lower()
        nominal = nominals[one.attrib["id"]]
        on = [features[each.text or ""] for each in nominal.findall(f"{Q}FeatureNominalIds/{Q}Id")]
        value = one.findtext(f"{Q}ToleranceValue")
        if kind == "angle":  # the angle between two faces, which is no size of a feature
            continue
        if value is None:
            low, high = (float(one.findtext(f"{Q}Tolerance/{Q}{end}") or 0) for end in ("MinValue", "MaxValue"))
            if one.findtext(f"{Q}Tolerance/{Q}DefinedAsLimit") == "false":
                target = float(nominal.findtext(f"{Q}TargetValue") or 0)
                low, high = low + target, high + target
            theirs.append((kind, round(low, 9), round(high, 9), ()))
        else:
            theirs.append((kind, float(value), 0.0, systems.get(one.findtext(f"{Q}DatumReferenceFrameId") or "", ())))
        same = [
            each for each in found.tolerances
            if each.kind == kind and any(lies_on(feature, [faces[k] for k in each.faces]) for feature in on)
        ]  # fmt: skip
        assert same or not any(is_simple(feature) for feature in on), (kind, value)
    for each in found.tolerances:
        low, high = each.limits or (each.value or 0.0, 0.0)
        ours.append((each.kind, round(low, 9), round(high, 9), each.datums))
    assert sorted(ours) == sorted(theirs)


def is_simple(feature: ElementTree.Element) -> bool:
    return feature.tag in (f"{Q}PlaneFeatureNominal", f"{Q}CylinderFeatureNominal")


def lies_on(feature: ElementTree.Element, faces: list[CadFace]) -> bool:
    """Whether a plane or a cylinder of QIF is that of one of the faces."""
    if feature.tag == f"{Q}PlaneFeatureNominal":
        at = np.array((feature.findtext(f"{Q}Location") or "").split(), float)
        normal = np.array((feature.findtext(f"{Q}Normal") or "").split(), float)
        return any(
            one.normal is not None
            and abs(np.dot(one.normal, normal)) > 1 - 1e-6
            and abs(np.dot(np.array(one.centre) - at, normal)) < 1e-3
            for one in faces
        )
    at = np.array((feature.findtext(f"{Q}Axis/{Q}AxisPoint") or "0 0 0").split(), float)
    along = np.array((feature.findtext(f"{Q}Axis/{Q}Direction") or "0 0 1").split(), float)
    return any(
        one.axis is not None
        and one.point is not None
        and abs(np.dot(one.axis, along)) > 1 - 1e-6
        and np.linalg.norm(np.cross(np.array(one.point) - at, along)) < 1e-3
        for one in faces
    )


def test_values_of_all_kinds_are_read() -> None:
    text = "#1=(A('it''s; (1)',$,*,.T.)B((#2,-1.5E-3),C(0.2)));\n#2 = D ( ) ;/* #3=E(); */ nonsense;#4=F((;"
    found = read_entities(text)
    assert found == {
        1: {"A": ("it's; (1)", None, None, ".T."), "B": ((Ref(2), -0.0015), Typed("C", (0.2,)))},
        2: {"D": ()},
    }


@given(st.text(alphabet="#=(),;'$*. ABC123\n/", max_size=60))
def test_no_text_stops_the_reader(text: str) -> None:
    read_entities(text)


@given(st.text(alphabet=st.characters(exclude_categories=["Cs"]), max_size=20), st.integers(1, 10**6))
def test_texts_come_back(text: str, number: int) -> None:
    quoted = text.replace("'", "''")
    assert read_entities(f"#{number}=NAME('{quoted}',#{number});") == {number: {"NAME": (text, Ref(number))}}
