"""Datums as measured features, and their system as a datum reference frame."""

from __future__ import annotations

from damageest.artefacts import DatumFit
from damageest.result import Result
from damageest_qif.elements import Element, Lists, attributes, make, make_list, refer, write_number, write_numbers
from damageest_qif.sites import make_item

PRECEDENCE = ("PRIMARY", "SECONDARY", "TERTIARY")
NAMES = {"plane": "Plane", "cylinder": "Cylinder", "sphere": "Sphere", "cone": "OtherSurface"}
"""Features of QIF. A cone needs a diameter at its location, which a datum has not: it is a surface with attributes."""


def add_datums(lists: Lists, result: Result) -> None:
    """Adds the datums of a datum system; nothing where the pose was fitted to all of the skin."""
    used = []
    for datum, precedence in zip(result.pose.datums, PRECEDENCE, strict=False):
        nominals = _add_features(lists, datum)
        number = lists.numbers.take()
        lists.datums.append(
            make(
                "DatumDefinition", make("DatumLabel", text=datum.name), refer("FeatureNominalIds", nominals), id=number
            )
        )
        simple = make(
            "SimpleDatum",
            make("DatumDefinitionId", text=number),
            make("MaterialModifier", text="NONE"),
            make("ReferencedComponent", text="ACTUAL"),
        )
        used.append(make("Datum", simple, make("Precedence", make("PrecedenceEnum", text=precedence))))
    if used:
        left = "; ".join(one.text for one in result.pose.left)
        lists.frames.append(
            make(
                "DatumReferenceFrame",
                attributes([("left_free", left)] if left else []),
                make_list("Datums", used),
                make("Name", text="|".join(one.name for one in result.pose.datums)),
                id=lists.numbers.take(),
            )
        )


def _add_features(lists: Lists, datum: DatumFit) -> list[str]:
    """Adds the features of a datum, one for each shape, and gives the numbers of their nominals."""
    found = []
    radii = iter(zip(datum.nominal, datum.measured, strict=True))
    entities = [lists.entities[face].attrib["id"] for face in datum.faces if face in lists.entities]
    several = len(datum.shapes) > 1
    for k, shape in enumerate(datum.shapes):
        definition, nominal, item, measured = (lists.numbers.take() for _ in range(4))
        name = f"datum-{datum.name}" + (f"-{k + 1}" if several else "")
        kind = NAMES[shape]
        radius = next(radii) if shape in ("cylinder", "sphere") else None
        lists.feature_definitions.append(
            make(f"{kind}FeatureDefinition", *_define(radius, datum.bores[k]), id=definition)
        )
        place = _place(shape, datum.places[k], datum.axes[k])
        lists.feature_nominals.append(
            make(
                f"{kind}FeatureNominal",
                make("Name", text=name),
                make("FeatureDefinitionId", text=definition),
                refer("EntityExternalIds", entities),
                *place,
                id=nominal,
            )
        )
        lists.feature_items.append(make_item(kind, item, nominal, name))
        told = attributes(
            [("takes", "; ".join(datum.takes))],
            [("points", datum.points), ("contact", datum.contact), ("worn", datum.inside), ("rms", datum.rms)],
        )
        diameter = None if radius is None else make("Diameter", text=write_number(2 * radius[1]))
        lists.feature_measurements.append(
            make(
                f"{kind}FeatureMeasurement", told, make("FeatureItemId", text=item), *_place(shape, datum.places[k],
                datum.axes[k]), diameter, id=measured,
            )
        )  # fmt: skip
        found.append(nominal)
    return found


def _define(radius: tuple[float, float] | None, is_bore: bool) -> list[Element]:
    if radius is None:
        return []
    return [
        make("InternalExternal", text="INTERNAL" if is_bore else "EXTERNAL"),
        make("Diameter", text=write_number(2 * radius[0])),
    ]


def _place(shape: str, place: tuple[float, ...], axis: tuple[float, ...]) -> list[Element]:
    """Location and direction. In the part's frame, which the datums define, a measured datum lies where it should."""
    at, along = write_numbers(place), write_numbers(axis)
    if shape == "plane":
        return [make("Location", text=at), make("Normal", text=along)]
    if shape == "cylinder":
        return [make("Axis", make("AxisPoint", text=at), make("Direction", text=along))]
    return [make("Location", text=at)] if shape == "sphere" else []
