"""The QIF document of a result."""

from __future__ import annotations

import hashlib
import uuid
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from damageest.result import Result
from damageest.stages.export import ExportedFiles
from damageest_qif.datums import add_datums
from damageest_qif.elements import NAMESPACE, Element, Lists, attributes, clean, make, make_list, refer
from damageest_qif.sites import Lost, add_site, find_lost, name_interval

NAME = "result.qif"
METRES = {"um": "0.000001", "mm": "0.001", "cm": "0.01", "m": "1", "in": "0.0254", "ft": "0.3048"}
SQUARE = {"um": "0.000000000001", "mm": "0.000001", "cm": "0.0001", "m": "1", "in": "0.00064516", "ft": "0.09290304"}
NOT_EXACT = (
    "result.qif is in the frame of the adapted part, which follows the scan; its deviations are from that, not from "
    "the part as designed"
)


def write_document(folder: Path, result: Result) -> ExportedFiles:
    """Writes ``folder/result.qif``, in the part's frame and in the result's unit. The same result gives the same
    bytes: there is no time in it, and its identifier is made from its content."""
    root = build_document(result)
    ElementTree.indent(root, " ")
    body = ElementTree.tostring(root, encoding="unicode")
    digest = hashlib.sha256(body.encode()).digest()
    identifier = str(uuid.UUID(bytes=digest[:16], version=5))
    text = '<?xml version="1.0" encoding="UTF-8"?>\n' + body.replace(_OPEN, identifier, 1) + "\n"
    (folder / NAME).write_text(text, encoding="utf-8", newline="\n")
    notes = (NOT_EXACT,) if result.adapted is not None else ()
    return ExportedFiles((NAME,), notes)


_OPEN = "00000000-0000-0000-0000-000000000000"


def build_document(result: Result) -> Element:
    """The root element, its identifier still open."""
    lists = Lists()
    numbers = [lists.numbers.take() for _ in range(9)]
    software, model, definition, part, component, path, results, actual, standard = numbers
    lost = [find_lost(result, site) for site in result.sites]
    _list_entities(lists, result, lost)
    add_datums(lists, result)
    for site, skin in zip(result.sites, lost, strict=True):
        add_site(lists, result, site, skin)
    children = [
        make("QPId", text=_OPEN),
        _make_header(result),
        make_list("StandardsDefinitions", [_make_standard(standard)]),
        make_list(
            "SoftwareDefinitions",
            [
                make(
                    "Software",
                    make("VendorName", text="damageest"),
                    make("ApplicationName", text="damageest"),
                    make("Version", text=version("damageest")),
                    id=software,
                )
            ],
        ),
        _make_units(result.units),
        make_list("DatumDefinitions", lists.datums),
        make_list("DatumReferenceFrames", lists.frames),
        _make_product(lists, result, model, definition, part, component, path),
        _join(
            "Features",
            FeatureDefinitions=lists.feature_definitions,
            FeatureNominals=lists.feature_nominals,
            FeatureItems=lists.feature_items,
        ),
        _join(
            "Characteristics",
            make("FormalStandardId", text=standard),
            CharacteristicDefinitions=lists.definitions,
            CharacteristicNominals=lists.nominals,
            CharacteristicItems=lists.items,
        ),
        _make_results(lists, result, results, actual, path),
    ]
    return make("QIFDocument", *children, xmlns=NAMESPACE, versionQIF="3.0.0", idMax=str(lists.numbers.last))


def _join(name: str, *first: Element, **lists: list[Element]) -> Element | None:
    made = [make_list(kind, found) for kind, found in lists.items()]
    return make(name, *first, *made) if any(one is not None for one in made) else None


def _make_standard(number: str) -> Element:
    """The standard that words as profile and datum are taken from."""
    organization = make("Organization", make("StandardsOrganizationEnum", text="ISO"))
    return make("Standard", organization, make("Designator", text="1101"), make("Year", text="2017"), id=number)


def _list_entities(lists: Lists, result: Result, lost: Sequence[Lost]) -> None:
    """The CAD faces that sites and datums refer to, by the numbers that `damageest faces` lists."""
    used = {face for skin in lost for face in skin.faces}
    used |= {face for datum in result.pose.datums for face in datum.faces}
    names = result.part.face_names
    for face in sorted(used):
        name = clean(names[face]) if face < len(names) and names[face].strip() else ""
        lists.entities[face] = make(
            "Entity", make("EntityId", text=str(face)), make("Name", text=name) if name else None,
            id=lists.numbers.take(),
        )  # fmt: skip


def _make_header(result: Result) -> Element:
    application = make("Application", make("Name", text="damageest"))
    return make("Header", application, make("Description", text=clean(result.name)))


def _make_units(unit: str) -> Element:
    def convert(name: str, si: str, shown: str, factor: str) -> Element:
        return make(
            name, make("SIUnitName", text=si), make("UnitName", text=shown),
            make("UnitConversion", make("Factor", text=factor)),
        )  # fmt: skip

    primary = [
        convert("AreaUnit", "square meter", f"{unit}2", SQUARE[unit]),
        make("AngularUnit", make("SIUnitName", text="radian"), make("UnitName", text="radian")),
        convert("LinearUnit", "meter", unit, METRES[unit]),
    ]
    return make("FileUnits", make("PrimaryUnits", *primary))


def _make_product(
    lists: Lists, result: Result, model: str, definition: str, part: str, component: str, path: str
) -> Element:
    """The part with its CAD file, whose faces are entities."""
    name = Path(result.part.path).name or "part"
    file = make("File", make("Name", text=clean(name)))
    digital = make(
        "DigitalModel",
        make("Name", text=clean(name)),
        file,
        make_list("Entities", list(lists.entities.values())),
        id=model,
    )
    kept = attributes(
        [("sha256", result.part.sha256)] if result.part.sha256 else [],
        [("tessellation_error", result.part.tessellation_error), ("volume", result.part.volume)],
    )
    of_part = make("Part", kept, make("DefinitionExternal", digital, id=definition, n="1"), id=part)
    of_component = make("Component", make("Part", make("Id", text=part)), id=component)
    of_path = make("AsmPath", refer("ComponentIds", [component]), id=path)
    return make(
        "Product",
        make_list("PartSet", [of_part]),
        make_list("ComponentSet", [of_component]),
        make_list("AsmPaths", [of_path]),
    )


def _make_results(lists: Lists, result: Result, number: str, actual: str, path: str) -> Element:
    """What was measured: the run as a whole as attributes, features, inner surfaces, characteristics."""
    status = "FAIL" if any(site.accepted for site in result.sites) else "PASS"
    if result.failures or any(not site.accepted for site in result.sites):
        status = "UNKNOWN"
    pose = result.pose
    texts = [
        ("status", result.status),
        ("T_part_scan", " ".join(f"{one:.17g}" for one in pose.T_part_scan.ravel().tolist())),
        ("scan", "; ".join(Path(one).name for one in result.scan.paths)),
        *((f"warning:{one.code}", one.text) for one in result.warnings),
        *(("failure", one) for one in result.failures),
    ]
    numbers = [
        ("tolerance", result.tolerance),
        ("points", float(len(result.scan.points))),
        ("noise", result.scan.noise),
        ("alignment_rms", pose.rms),
        ("damage_volume", result.damage_volume),
        *name_interval("damage_volume", result.volume_95),
    ]
    state = make("InspectionStatus", make("InspectionStatusEnum", text=status))
    measured = make_list("CharacteristicMeasurements", lists.measurements)
    of_results = make(
        "MeasurementResults",
        attributes(texts, [one for one in numbers if np.isfinite(one[1])]),
        make_list("MeasuredFeatures", lists.feature_measurements),
        make_list("MeasuredPointSets", lists.point_sets),
        make("MeasuredCharacteristics", measured) if measured is not None else None,
        state,
        refer("ActualComponentIds", [actual]),
        id=number,
    )
    of_actual = make(
        "ActualComponent",
        make("Status", make("InspectionStatusEnum", text=status)),
        make("AsmPathId", text=path),
        id=actual,
    )
    sets = make_list("ActualComponentSets", [make("ActualComponentSet", of_actual, n="1")])
    return make("Results", make("MeasurementResultsSet", of_results, n="1"), sets)
