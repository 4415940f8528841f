"""Datums, datum systems and tolerances of a STEP AP242 file, with the CAD faces that they refer to."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

from damageest.stages.part import CadDatum, CadPmi, CadTolerance
from damageest_cadquery.reading._part21 import Entity, Ref, Typed, Value, read_entities

DRAWN = ("DRAUGHTING_CALLOUT", "ANNOTATION_OCCURRENCE", "TESSELLATED_ANNOTATION_OCCURRENCE", "ANNOTATION_PLANE")
"""Entities of PMI that is only drawn."""
DEEPEST = 6
"""Aspects of aspects, as a pattern of composite features."""


@dataclass(frozen=True)
class _File:
    """``entities`` by number; ``faces``: the number of the CAD face of each ADVANCED_FACE entity; ``scale``: one length
    of the file in the job's unit."""

    entities: Mapping[int, Entity]
    faces: Mapping[int, int]
    scale: float

    def of(self, name: str) -> Iterator[tuple[int, tuple[Value, ...]]]:
        """The entities of a type, also as a part of complex ones."""
        for number, entity in self.entities.items():
            if name in entity:
                yield number, entity[name]


def find_pmi(text: str, faces: Mapping[int, int], scale: float) -> CadPmi:
    """What a STEP file says of datums and tolerances.

    Args:
        text: the file.
        faces: the number of the CAD face of each ADVANCED_FACE entity, by the entity's place among those of the file.
        scale: one length of the file in the unit of the amounts wanted.
    """
    entities = read_entities(text)
    in_order = [number for number, entity in entities.items() if "ADVANCED_FACE" in entity]
    known = {number: faces[place] for place, number in enumerate(in_order) if place in faces}
    file = _File(entities, known, scale)
    aspects, broken = _find_faces(file)
    letters = {number: str(values[-1]) for number, values in file.of("DATUM")}
    datums = _find_datums(file, aspects, letters)
    systems = {number: _read_system(file, values, letters) for number, values in file.of("DATUM_SYSTEM")}
    tolerances = (*_find_tolerances(file, aspects, systems), *_find_sizes(file, aspects))
    notes = []
    if broken:
        notes.append(f"{broken} references of datums and tolerances have no target in the file; export it again")
    if not datums and not tolerances:
        drawn = any(name in entity for entity in file.entities.values() for name in DRAWN)
        notes.append(
            "the file has its datums and tolerances as drawings only: people can read them, programs cannot; export it "
            "with semantic PMI" if drawn else "the file has no datums and no tolerances"
        )  # fmt: skip
    targets = any("PLACED_DATUM_TARGET_FEATURE" in entity or "DATUM_TARGET" in entity for entity in entities.values())
    more = "; the file has datum targets, points or areas of a datum, which are not read" if targets else ""
    notes += [f"datum {one.name}: no CAD face is given for it{more}" for one in datums if not one.faces]
    notes += [f"{one.kind} '{one.name}': no CAD face is given for it" for one in tolerances if not one.faces]
    notes += [f"{one.kind} '{one.name}': its amount could not be read" for one in tolerances if one.value is None]
    return CadPmi(datums, tuple(dict.fromkeys(one for one in systems.values() if one)), tolerances, tuple(notes))


def _find_faces(file: _File) -> tuple[dict[int, set[int]], int]:
    """The CAD faces of each shape aspect, those of aspects that it is made of among them; and the number of references
    to entities that are not there."""
    own: dict[int, set[int]] = {}
    broken = 0
    usages = [*file.of("GEOMETRIC_ITEM_SPECIFIC_USAGE"), *file.of("ITEM_IDENTIFIED_REPRESENTATION_USAGE")]
    for _, values in usages:
        if len(values) < 5 or not isinstance(values[2], Ref):
            continue
        items = list(_list_refs(values[4]))
        broken += sum(number not in file.entities for number in (*items, values[2].number))
        own.setdefault(values[2].number, set()).update(file.faces[one] for one in items if one in file.faces)
    parts: dict[int, set[int]] = {}
    for _, values in file.of("SHAPE_ASPECT_RELATIONSHIP"):
        if len(values) >= 4 and isinstance(values[2], Ref) and isinstance(values[3], Ref):
            broken += sum(one.number not in file.entities for one in values[2:4] if isinstance(one, Ref))
            if "DATUM" not in file.entities.get(values[3].number, {}):
                parts.setdefault(values[2].number, set()).add(values[3].number)

    def gather(aspect: int, depth: int) -> set[int]:
        found = set(own.get(aspect, ()))
        for part in parts.get(aspect, ()) if depth else ():
            found |= gather(part, depth - 1)
        return found

    return {aspect: gather(aspect, DEEPEST) for aspect in own.keys() | parts.keys()}, broken


def _list_refs(value: Value) -> Iterator[int]:
    """The references in a value, at any depth."""
    if isinstance(value, Ref):
        yield value.number
    elif isinstance(value, Typed):
        yield from _list_refs(value.values)
    elif isinstance(value, tuple):
        for one in value:
            yield from _list_refs(one)


def _find_datums(file: _File, aspects: Mapping[int, set[int]], letters: Mapping[int, str]) -> tuple[CadDatum, ...]:
    """Datums with the faces of their features and targets."""
    found: dict[str, set[int]] = {letter: set() for letter in letters.values()}
    for _, values in file.of("SHAPE_ASPECT_RELATIONSHIP"):
        related = [one.number for one in values[2:4] if isinstance(one, Ref)]
        for number in related:
            if number in letters:
                for other in related:
                    found[letters[number]] |= aspects.get(other, set())
    return tuple(CadDatum(letter, tuple(sorted(faces))) for letter, faces in sorted(found.items()))


def _read_system(file: _File, values: tuple[Value, ...], letters: Mapping[int, str]) -> tuple[str, ...]:
    """The letters of a system in the order of precedence; those of a common datum are joined, as in A-B."""
    found = []
    for compartment in _list_refs(values[-1]):
        base = next(iter(file.entities.get(compartment, {}).values()), ())
        common = [
            letters[one] for part in _list_refs(base[4:5]) for one in _follow_common(file, part) if one in letters
        ]
        if common:
            found.append("-".join(common))
    return tuple(found)


def _follow_common(file: _File, number: int) -> Iterator[int]:
    """A datum itself, or those of the elements of a common datum."""
    entity = file.entities.get(number, {})
    if "DATUM_REFERENCE_ELEMENT" in entity:
        yield from _list_refs(entity["DATUM_REFERENCE_ELEMENT"][4:5])
    else:
        yield number


def _find_tolerances(
    file: _File, aspects: Mapping[int, set[int]], systems: Mapping[int, tuple[str, ...]]
) -> Iterator[CadTolerance]:
    """Geometrical tolerances: flatness, position, profile and so on."""
    for entity in file.entities.values():
        kinds = [
            name for name in entity
            if name.endswith("_TOLERANCE") and not name.startswith(("GEOMETRIC", "UNEQUALLY", "MODIFIED", "PLUS_MINUS"))
        ]  # fmt: skip
        if not kinds:
            continue
        values = entity.get("GEOMETRIC_TOLERANCE") or entity[kinds[0]]
        if len(values) < 4:
            continue
        amount = next((_measure(file, one) for one in _list_refs(values[2])), None)
        faces: set[int] = set().union(*(aspects.get(one, set()) for one in _list_refs(values[3])))
        referred = entity.get("GEOMETRIC_TOLERANCE_WITH_DATUM_REFERENCE", values[4:5] if len(values) > 4 else ())
        datums = next((systems[one] for one in _list_refs(referred) if one in systems), ())
        kind = kinds[0].removesuffix("_TOLERANCE").lower()
        yield CadTolerance(kind, str(values[0] or ""), amount, tuple(sorted(faces)), datums)


def _find_sizes(file: _File, aspects: Mapping[int, set[int]]) -> Iterator[CadTolerance]:
    """Sizes with limits: the value is the width of the zone."""
    nominal: dict[int, list[float]] = {}
    for _, values in file.of("DIMENSIONAL_CHARACTERISTIC_REPRESENTATION"):
        dimension, shown = (next(_list_refs(one), 0) for one in values[:2])
        items = file.entities.get(shown, {}).get("SHAPE_DIMENSION_REPRESENTATION", ())
        amounts = [_measure(file, one) for one in _list_refs(items)]
        nominal[dimension] = [one for one in amounts if one is not None]
    limits: dict[int, tuple[float, float]] = {}
    for _, values in file.of("PLUS_MINUS_TOLERANCE"):
        given = file.entities.get(next(_list_refs(values[0]), 0), {}).get("TOLERANCE_VALUE", ())
        ends = [_measure(file, one) for one in _list_refs(given)]
        if len(ends) == 2 and None not in ends:
            limits[next(_list_refs(values[1]), 0)] = (float(ends[0] or 0), float(ends[1] or 0))
    for number, values in file.of("DIMENSIONAL_SIZE"):
        size = nominal.get(number, [])
        if number in limits and size:
            low, high = (round(size[0] + end, 12) for end in limits[number])
        elif len(size) > 1:
            low, high = min(size), max(size)
        else:
            continue
        middle = size[0] if number in limits else sorted(size)[len(size) // 2]
        faces: set[int] = set().union(*(aspects.get(one, set()) for one in _list_refs(values[0])))
        yield CadTolerance(
            str(values[1] or "size"), f"size {middle:g}", round(high - low, 12), tuple(sorted(faces)), (), (low, high)
        )


def _measure(file: _File, number: int) -> float | None:
    """An amount of length in the unit wanted; None for another quantity, or where it is not there."""
    entity = file.entities.get(number, {})
    for name in ("MEASURE_WITH_UNIT", "LENGTH_MEASURE_WITH_UNIT"):
        for one in _list_typed(entity.get(name, ())):
            if one.name in ("LENGTH_MEASURE", "POSITIVE_LENGTH_MEASURE") and isinstance(one.values[0], float):
                return one.values[0] * file.scale
    return None


def _list_typed(values: Iterable[Value]) -> Iterator[Typed]:
    return (one for one in values if isinstance(one, Typed))
