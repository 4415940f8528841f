"""Target of a part after a step of its repair."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from damageest.artefacts import Mesh, Part, Solid
from damageest.errors import InputError
from damageest.geometry.make_part import make_part
from damageest.geometry.solids import to_manifold, to_solid, unite
from damageest.output.folder import OutputFolder, open_output
from damageest.output.verification import find_changes, read_provenance

Step = Literal["deposited", "milled"]


@dataclass(frozen=True, eq=False)
class Aim:
    """``folder``: output of the run before the repair. ``target``: the part after a perfect step; ``nominal``: as
    designed, or adapted to the scan before. ``deposits``: planned deposits, by number of site; ``stock``: their least
    height above the skin, by site. ``refused``: sites that the result did not accept, or without a deposit."""

    folder: OutputFolder
    step: Step
    target: Part
    nominal: Solid
    deposits: dict[int, Solid]
    stock: dict[int, float]
    refused: tuple[int, ...]


def read_aim(folder: Path, step: Step) -> Aim:
    """Reads the output of a run, and builds the target of the step.

    Raises InputError where the folder is no result, was changed after the run, or has no repair.
    """
    output = open_output(folder)
    read_provenance(folder, output.content)
    changed = [text for text in find_changes(folder, output.content) if not text.startswith("input ")]
    if changed:
        raise InputError(f"{folder}: was changed after the run: {changed[0]}; inspect what the run wrote, or run again")
    if output.place != folder:
        raise InputError(f"{folder}: its files are not in the part's frame; run the job again with frame: part")
    deposits: dict[int, Solid] = {}
    stock: dict[int, float] = {}
    refused: list[int] = []
    for site in output.content["sites"]:
        body = output.read_solid("deposit", site["id"]) or output.read_solid("damage", site["id"])
        if not site["accepted"] or body is None:
            refused.append(site["id"])
            continue
        deposits[site["id"]] = make_part(body.vertices, body.faces, unit=output.unit)
        thickness = (site.get("deposit") or {}).get("thickness")
        stock[site["id"]] = float(thickness["min"]) if thickness else 0.0
    if not deposits:
        raise InputError(f"{folder}: the result has no accepted site to repair")
    nominal = _read_nominal(output, deposits)
    origin = nominal.bounds.mean(axis=0)
    target: Mesh | None = nominal
    if step == "deposited":
        target = to_solid(unite([nominal, *deposits.values()], origin), origin)
        if target is None:
            raise InputError(f"{folder}: part and deposits do not unite to one solid; run the job again")
    assert target is not None
    return Aim(output, step, Part(target.vertices, target.faces, unit=output.unit), nominal, deposits, stock,
               tuple(refused))  # fmt: skip


def _read_nominal(output: OutputFolder, deposits: dict[int, Solid]) -> Solid:
    """The part of the run: the undamaged metal united with all damage volumes."""
    undamaged = output.read_solid("undamaged")
    lost = [output.read_solid("damage", number) for number in deposits]
    if undamaged is None or any(body is None for body in lost):
        raise InputError(
            f"{output.folder}: no readable file has the undamaged part and the damage volumes; run the job again "
            "with export: {format: [ply]}"
        )
    origin = undamaged.bounds.mean(axis=0)
    bodies = [make_part(body.vertices, body.faces, unit=output.unit) for body in (undamaged, *lost) if body is not None]
    # in files of single precision, faces that coincide are apart by rounding: swollen by that, they meet
    whole = unite([_swell(body) for body in bodies], origin)
    solid = to_solid(whole, origin)
    if solid is None:
        raise InputError(
            f"{output.folder}: undamaged part and damage volumes do not unite to one solid; run the job again"
        )
    return solid


def _swell(body: Mesh) -> Mesh:
    """A mesh with its vertices moved outward by the rounding of files of single precision."""
    normals = np.zeros((len(body.vertices), 3))
    for k in range(3):
        np.add.at(normals, body.faces[:, k], body.cross)
    size = np.linalg.norm(normals, axis=1, keepdims=True)
    step = 4 * np.finfo(np.float32).eps * float(np.abs(body.vertices).max())
    return Mesh(body.vertices + step * normals / np.maximum(size, 1e-300), body.faces)


def join(bodies: list[Solid]) -> Any:
    """Solids as one Manifold about the origin."""
    return unite(bodies, np.zeros(3))


def cut_volume(body: Solid, inside: Any) -> float:
    """Volume of a solid that lies in a Manifold about the origin."""
    return float((to_manifold(body) ^ inside).volume())
