"""The result of an adapted part, moved back to the part as designed by the inverse of its field."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

from damageest.artefacts import ArtefactError, DisplacementField, Solid, Surface
from damageest.errors import StageError
from damageest.geometry.undoing import count_crossings, cut_to_follow, undo
from damageest.stages.export import Body, ExportedFiles

if TYPE_CHECKING:
    from damageest.result import Result

FOLLOWS = 0.1
"""How far moved triangles may lie off what they are moved to, in tolerances."""
REMEDY = "frame: part, which is that of the adapted part"


@dataclass(frozen=True, eq=False)
class Nominal:
    """``result``: with surfaces, scan and skin moved back, and without paths; ``bodies``: by the stems of their files.
    ``left_out``: the names of those that are no solids there, and why."""

    result: Result
    bodies: Mapping[str, Body]
    left_out: tuple[str, ...]
    has_paths: bool

    def tell(self, has_splines: bool, has_exact: bool) -> ExportedFiles:
        """What is said of the files."""
        notes = tuple(f"nominal_frame/ lacks {each}" for each in self.left_out)
        if has_exact:
            notes += ("STEP solids in nominal_frame/ have facets, not the faces of the CAD file",)
        if self.has_paths:
            notes += ("nominal_frame/ holds no paths: a nozzle has to follow the adapted part",)
        if has_splines:
            notes += ("nominal_frame/ holds no splines of the inner damage surfaces",)
        return ExportedFiles(notes=notes, warnings=notes)


def map_to_nominal(result: Result, bodies: Mapping[str, Body]) -> Nominal:
    """Moves back what was found on an adapted part. Raises StageError where its stage gave no field, or where the field
    has no inverse."""
    assert result.adapted is not None
    field = result.adapted.field
    if field is None:
        raise StageError(
            "frame: nominal is not possible: the stage adapt gives no displacement field to move solids back",
            f"{REMEDY}, or a stage adapt that gives one, such as adapt: smooth",
        )
    try:
        return _map(result, bodies, field)
    except ArithmeticError as problem:
        raise StageError(f"frame: nominal is not possible: {problem}", REMEDY) from None


def _map(result: Result, bodies: Mapping[str, Body], field: DisplacementField) -> Nominal:
    move, within = partial(undo, field), FOLLOWS * result.tolerance
    moved: dict[str, Body] = {}
    left_out: list[str] = []
    for stem, body in bodies.items():
        vertices, faces = cut_to_follow(body.solid, move, within)
        try:
            solid = Solid(vertices, faces)
        except ArtefactError as problem:
            left_out.append(f"{body.name}: it would be no solid: {problem}")
            continue
        if count_crossings(solid) and not count_crossings(body.solid):
            left_out.append(f"{body.name}: it would intersect itself")
            continue
        moved[stem] = replace(body, solid=solid)
    surfaces = [Surface(*cut_to_follow(site.surface, move, within)) for site in result.sites]
    sites = [replace(site, surface=own, path=None) for site, own in zip(result.sites, surfaces, strict=True)]
    coverage = result.coverage
    if coverage is not None:  # its triangles stay: each has a value of its own
        coverage = replace(coverage, skin=replace(coverage.skin, vertices=move(coverage.skin.vertices)))
    aligned = replace(result.aligned, points=move(result.aligned.points))
    there = replace(result, sites=tuple(sites), coverage=coverage, aligned=aligned)
    return Nominal(there, moved, tuple(left_out), any(site.path is not None for site in result.sites))
