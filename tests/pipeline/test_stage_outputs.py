"""A value that a plugin's stage gives and that cannot be right is an error that names the stage and the plugin.

The sweep spoils a valid value of each contract, field by field, in every way that its type has.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from damageest.artefacts import (
    AdaptedPart,
    Deposit,
    Enclosure,
    Enclosures,
    Mesh,
    Pose,
    Rims,
    Scan,
    Sites,
    Solid,
)
from damageest.errors import StageError
from damageest.pipeline.begin import start
from damageest.pipeline.engine import follow
from damageest.pipeline.finding.sites import take_enclosures
from damageest.registry import Registry
from damageest.registry.contracts import DEFAULTS
from damageest.registry.outputs import CHECKS
from damageest.stages.export import ExportedFiles
from damageest.stages.report import ReportFiles
from tests.pipeline.stage_values import NAMES, call, make_given, make_valid


def spoil(value: Any) -> Iterator[tuple[str, Any]]:
    """Values that are wrong in place of an array, a number or a tuple."""
    yield "text", "much"
    yield "object", object()
    if isinstance(value, np.ndarray):
        yield "None", None
        yield "complex", value.astype(complex)
        yield "deeper", value[None]
        yield "scalar", value.reshape(-1)[0]
        yield "twice as long", np.concatenate([value, value])
        yield "one row less", value[:-1]
        first = (0,) * value.ndim
        for bad in (np.nan, np.inf, -1e300, -7.5, 10.0**9):
            if value.dtype == bool and bad == 10.0**9:
                continue
            other = value.astype(float)
            other[first] = bad
            yield f"{bad:g}", other
    elif isinstance(value, (bool, np.bool_)):
        yield "number", 7
    elif isinstance(value, (int, float)):
        yield from (("None", None), ("NaN", np.nan), ("-inf", -np.inf), ("true", True), ("-1", -1))
    elif isinstance(value, tuple):
        yield from (("None", None), ("number", 3), ("of objects", (object(),)), ("of None", (None,)))


LEGAL = {
    # any finite place is one; a spoiled one is wrong, but not invalid
    ("Sample", "points"): ("-1e+300", "-7.5", "1e+09"),
    ("Sample", "normals"): ("-1e+300", "-7.5", "1e+09"),
    ("ReadScan", "points"): ("-1e+300", "-7.5", "1e+09"),
    ("ReadScan", "normals"): ("-1e+300", "-7.5", "1e+09", "None"),
    ("ReadScan", "viewpoints"): ("-1e+300", "-7.5", "1e+09", "twice as long", "one row less"),
    ("Segment", "distance"): ("-1e+300", "-7.5", "1e+09"),
    ("Path", "points"): ("-1e+300", "-7.5", "1e+09"),
    ("Path", "normals"): ("-1e+300", "-7.5", "1e+09"),
    ("Path", "directions"): ("-1e+300", "-7.5", "1e+09"),
    ("Path", "heights"): ("-1e+300", "-7.5", "1e+09"),
    ("Path", "section"): ("-1e+300", "-7.5", "1e+09"),
    ("Path", "feed"): ("1e+09",),
    ("Path", "layer"): ("1e+09",),
    ("Path", "number"): ("1e+09",),
    ("Path", "tightest"): ("-1e+300", "-7.5", "1e+09", "None", "nan", "inf"),
    ("Path", "clearance"): ("-1",),
    ("Path", "travel_clearance"): ("-1",),
    ("Align", "alternatives"): ("None", "twice as long", "one row less"),
    ("Adapt", "displacement"): ("-7.5",),  # leads back to the skin by chance
    ("Adapt", "other"): ("-1e+300", "-7.5", "1e+09", "None"),
    ("Adapt", "modes"): ("-1e+300", "-7.5", "1e+09", "twice as long", "one row less"),
    ("ReadPart", "faces_brep"): ("None", "1e+09", "-7.5"),
    # a mesh with other vertices or fewer triangles is a mesh
    ("Reconstruct", "vertices"): ("-1e+300", "-7.5", "1e+09", "twice as long"),
    ("Reconstruct", "faces"): ("twice as long", "one row less"),
    ("Enclose", "vertices"): ("-1e+300", "-7.5", "1e+09", "twice as long"),
    ("Enclose", "faces"): ("twice as long", "one row less"),
    **{
        (name, "vertices"): ("twice as long", "-7.5", "1e+09", "-1e+300")
        for name in ("Background", "Repair", "ReadPart")
    },
    ("Boolean", "vertices"): ("twice as long", "-7.5"),
    ("Allowance", "thickness"): ("None",),
    ("Allowance", "vertices"): ("twice as long", "-7.5", "1e+09", "-1e+300"),
}
"""Spoiled values that their types allow, by contract and field."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("out")


@pytest.mark.parametrize("name", NAMES)
def test_a_valid_value_passes(name: str, registry: Registry, folder: Path) -> None:
    value = make_valid(folder)[name]
    assert call(NAMES[name], lambda: value, registry, folder) is value


@pytest.mark.parametrize("name", NAMES)
def test_every_spoiled_field_is_an_error_with_stage_and_plugin(name: str, registry: Registry, folder: Path) -> None:
    contract, value = NAMES[name], make_valid(folder)[name]
    passed, tried = [], 0
    for field in dataclasses.fields(value):
        before = getattr(value, field.name)
        if before is None:
            continue
        for way, bad in spoil(before):
            if way in LEGAL.get((name, field.name), ()) or (isinstance(before, str) and way == "text"):
                continue
            tried += 1
            try:
                call(contract, lambda: dataclasses.replace(value, **{field.name: bad}), registry, folder)  # noqa: B023
            except StageError as error:
                told = str(error)
                assert told.startswith(f"{contract.stage}: fake"), told
                assert "acme 1.2" in told, told
                assert "gave a result that is not valid" in told, told
            else:
                passed.append(f"{field.name}: {way}")
    assert not passed
    assert tried > 5


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("bad", [7, "text", {}, (), np.zeros(3)], ids=repr)
def test_a_value_of_another_type_is_an_error(name: str, bad: Any, registry: Registry, folder: Path) -> None:
    contract = NAMES[name]
    with pytest.raises(StageError, match=rf"{contract.stage}: fake.*gave a \w+ where its contract promises"):
        call(contract, lambda: bad, registry, folder)


SPOILED: dict[str, tuple[str, Callable[[dict[str, Any]], Any], str]] = {
    "a deformation of another part": (
        "Adapt",
        lambda g: AdaptedPart(
            g["part"], np.ones((len(g["part"].vertices), 3)), np.eye(4), np.zeros((0, len(g["part"].vertices), 3)), 1, 1
        ),
        "off the part as designed",
    ),
    "faces of another part": (
        "Segment",
        lambda g: dataclasses.replace(g["deviation"], face=g["deviation"].face + len(g["part"].faces)),
        "face: index outside the",
    ),
    "rows missing": (
        "Segment",
        lambda g: dataclasses.replace(
            g["deviation"], **{n: getattr(g["deviation"], n)[:-1] for n in ("distance", "face", "label")}
        ),
        "one for each scan point",
    ),
    "label outlier": (
        "Segment",
        lambda g: dataclasses.replace(g["deviation"], label=np.full(len(g["deviation"].label), 3)),
        "labels that segment gives",
    ),
    "sites of fewer points": ("Cluster", lambda g: Sites(g["sites"].label[:-1], 2), "one for each scan point"),
    "a site without points": ("Cluster", lambda g: Sites(g["sites"].label, 3), "of 3 sites, number 3 has no point"),
    "a huge count": ("Cluster", lambda g: Sites(g["sites"].label, 10**15), "has no point"),
    "sites of intact points": ("Cluster", lambda g: Sites(np.maximum(g["sites"].label, 1), 2), "not labelled DAMAGE"),
    "triangles of another part": (
        "Sample",
        lambda g: dataclasses.replace(g["samples"], face=g["samples"].face + 99),
        "triangles of the part",
    ),
    "no samples": ("Sample", lambda g: dataclasses.replace(g["samples"], spacing=0.0), "their spacing is 0"),
    "no points": ("ReadScan", lambda g: Scan(np.empty((0, 3))), "points: there are none"),
    "another unit": ("ReadScan", lambda g: dataclasses.replace(g["scan"], unit="in"), "expected the job's unit, mm"),
    "part in another unit": ("ReadPart", lambda g: dataclasses.replace(g["part"], unit="m"), "the job's unit, mm"),
    "vertices of another surface": ("Boundary", lambda g: Rims((np.arange(3) + 10**6,)), "vertices of the surface"),
    "inner vertices": ("Boundary", lambda g: Rims((np.arange(9) + 500,)), "not all steps follow edges"),
    "no rim": ("Boundary", lambda g: Rims(()), "loops: there are none"),
    "one edge twice": ("Boundary", lambda g: Rims((g["rims"].loops[0],) * 2), "is used twice"),
    "no triangles": (
        "Enclose",
        lambda g: Mesh(np.empty((0, 3)), np.empty((0, 3), int)),
        "faces: there are none",
    ),
    "a site that is not there": (
        "EncloseAll",
        lambda g: Enclosures((Enclosure(g["background"], (1, 3)),)),
        "names site 3, but there are 2",
    ),
    "a site in two enclosures": (
        "EncloseAll",
        lambda g: Enclosures((Enclosure(g["background"], (1,)), Enclosure(g["background"], (2, 1)))),
        "site 1 is in more than one",
    ),
    "damage outside the part": (
        "Boolean",
        lambda g: Solid(g["damage"].vertices + np.ones(3), g["damage"].faces),
        "reaches out of the enclosure",
    ),
    "the part as damage of a small enclosure": ("Boolean", lambda g: g["background"], "reaches out of the part"),
    "a small deposit": (
        "Allowance",
        lambda g: Deposit(g["damage"].vertices * 0.5, g["damage"].faces),
        "less than the damage volume",
    ),
    "a CAD face that is not there": (
        "Allowance",
        lambda g: Deposit(g["damage"].vertices, g["damage"].faces, touched=(4,)),
        "has no CAD face 4",
    ),
    "a file that is not there": ("Export", lambda g: ExportedFiles(("b.txt",)), "'b.txt' is not a file in the output"),
    "a file elsewhere": ("Report", lambda g: ReportFiles(("../a.txt",)), "is not a file in the output folder"),
}


@pytest.mark.parametrize("what", SPOILED)
def test_a_value_that_does_not_fit_the_inputs_is_an_error(what: str, registry: Registry, folder: Path) -> None:
    name, make, text = SPOILED[what]
    with pytest.raises(StageError) as caught:
        call(NAMES[name], lambda: make(make_given(folder)), registry, folder)
    told = str(caught.value)
    assert told.startswith(f"{NAMES[name].stage}: fake"), told
    assert text in told, told
    assert "acme 1.2" in told, told


def test_every_contract_with_inputs_to_fit_is_in_the_table() -> None:
    """Those that are not: what they give is checked in full by its own class."""
    assert {contract.__name__ for contract in DEFAULTS if contract not in CHECKS} == {
        "Align", "Background", "Repair", "Path",
    }  # fmt: skip


@pytest.mark.parametrize(
    ("pose", "text"),
    [
        (np.diag([1.002, 1.002, 1.002, 1]), "scale or shear"),
        (np.diag([-1.0, 1, 1, 1]), "mirrors"),
        (np.diag([1.0, 1, 1, 2]), "last row"),
        (np.eye(4) * np.nan, "not finite"),
        (np.eye(3), "got (3, 3)"),
        (np.full((4, 4), 1e300), "last row"),
        (np.vstack([np.full((3, 4), 1e300), [0, 0, 0, 1]]), "scale or shear"),
    ],
)
@pytest.mark.parametrize("place", ["pose", "alternatives"])
def test_a_pose_is_rigid(place: str, pose: Any, text: str, registry: Registry, folder: Path) -> None:
    def make() -> Pose:
        return Pose(pose) if place == "pose" else Pose(np.eye(4), alternatives=pose[None])

    with pytest.raises(StageError) as caught:
        call(NAMES["Align"], make, registry, folder)
    told = str(caught.value)
    assert text in told.replace("(1, 3, 3)", "(3, 3)"), told
    assert told.startswith("align: fake: gave a result that is not valid"), told


def test_other_methods_of_a_plugin_are_asked_with_its_name(registry: Registry, folder: Path) -> None:
    """As the reader's pieces, and the rank of a site."""
    engine = call(NAMES["Path"], lambda: make_valid(folder)["Path"], registry, folder, give_engine=True)
    assert engine.ask(NAMES["Path"], lambda: 3, int) == 3
    wrong: list[tuple[Any, str]] = [
        (lambda: "3", "expected int, got str"),
        (raise_exit, "GeneratorExit"),
        (lambda: 1 // 0, "Zero"),
    ]
    for ask, text in wrong:
        with pytest.raises(StageError, match=rf"(?s)path: fake: .*{text}.*acme 1\.2"):
            engine.ask(NAMES["Path"], ask, int)


def raise_exit() -> int:
    raise GeneratorExit


def test_a_site_without_an_enclosure_is_a_failure(registry: Registry, folder: Path) -> None:
    """It would be missing in the result else, without a word."""
    value = Enclosures((Enclosure(make_given(folder)["background"], (2,)),))
    engine = call(NAMES["EncloseAll"], lambda: value, registry, folder, give_engine=True)
    state = start(engine)
    for name, given in make_given(folder).items():
        state = state.with_named(name, given, "k")
    work = follow((NAMES["EncloseAll"], take_enclosures), engine, state)
    assert [candidate.clusters for candidate in work.candidates] == [(2,)]
    (failure,) = work.failures
    assert str(failure).startswith("enclose: fake (")
    assert "gave no enclosure of its points" in str(failure)
    assert failure.site == 1
