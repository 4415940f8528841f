"""What a stage gives, compared with what it was given: lengths, ranges and indices, by contract.

An artefact checks itself when it is made. What it cannot know is here: how many points the scan has, how many triangles
the part. A value that passes can be used by every later stage without an index error; whether it is right is for the
checks of the result and for `damageest.conformance`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np

from damageest.artefacts import (
    ADDED,
    DAMAGE,
    AdaptedPart,
    ArtefactError,
    Deposit,
    Deviation,
    Enclosures,
    Ints,
    Mesh,
    Part,
    Rims,
    Samples,
    Scan,
    Sites,
    Solid,
    Surface,
)
from damageest.artefacts.fields import require_finite, require_index, require_shape
from damageest.geometry.distance import distance_to_mesh
from damageest.registry.contracts import Contract
from damageest.stages.adapt import Adapt
from damageest.stages.allowance import Allowance
from damageest.stages.boolean import Boolean
from damageest.stages.boundary import Boundary
from damageest.stages.cluster import Cluster
from damageest.stages.enclose import Enclose, EncloseAll
from damageest.stages.export import Export, ExportedFiles
from damageest.stages.part import ReadPart
from damageest.stages.reconstruct import Reconstruct
from damageest.stages.report import Report, ReportFiles
from damageest.stages.sample import Sample
from damageest.stages.scan import ReadScan
from damageest.stages.segment import Segment

Get = Callable[[str], Any]
"""Gives a parameter of the contract's ``run`` by its name."""
SLACK = 1e-3
"""Share by which a result of solids may be off what is exactly right: the tools that make them round."""


def check_output(contract: Contract, value: Any, get: Get) -> None:
    """Raises ArtefactError for a value that does not fit the inputs. ``value`` is of the contract's type."""
    if value is not None and contract in CHECKS:
        CHECKS[contract](value, get)


def _check_part(part: Part, get: Get) -> None:
    _require_unit(part.unit, get)


def _check_scan(scan: Scan, get: Get) -> None:
    _require_unit(scan.unit, get)
    if not len(scan.points):
        raise ArtefactError("points: there are none")
    require_finite("points", scan.points)
    if scan.normals is not None:
        require_finite("normals", scan.normals)
    if scan.total and scan.total < len(scan.points):
        raise ArtefactError(f"total: {scan.total} is less than the {len(scan.points)} points that are here")


def _check_samples(samples: Samples, get: Get) -> None:
    if not len(samples.points) or not samples.spacing > 0:
        raise ArtefactError("points: there are none, or their spacing is 0")
    require_index("face", samples.face, len(get("part").faces), "triangles of the part")


def _check_adapted(adapted: AdaptedPart, get: Get) -> None:
    part: Part = get("part")
    if adapted.part.unit != part.unit:
        raise ArtefactError(f"part: its unit is {adapted.part.unit}, that of the part as designed {part.unit}")
    if (adapted.part.faces_brep is None) != (part.faces_brep is None):
        raise ArtefactError("part: has other CAD faces than the part as designed")
    off = float(np.abs(adapted.displacement).max())
    if off < part.diagonal:
        off = float(distance_to_mesh(adapted.part.vertices - adapted.displacement, part).max())
    if off > SLACK * part.diagonal:
        raise ArtefactError(f"displacement: it leads back to places that are {off:.3g} off the part as designed")


def _check_deviation(deviation: Deviation, get: Get) -> None:
    require_shape("distance, face, label: one for each scan point", deviation.distance, len(get("aligned").points))
    require_index("face", deviation.face, len(get("part").faces), "triangles of the part")
    require_index("label", deviation.label, ADDED + 1, "labels that segment gives, INTACT, DAMAGE, ADDED")


def _check_sites(sites: Sites, get: Get) -> None:
    label = get("deviation").label
    require_shape("label: one for each scan point", sites.label, len(label))
    if missing := np.setdiff1d(np.arange(1, min(sites.count, len(label) + 1) + 1), sites.label)[:1].tolist():
        raise ArtefactError(f"count: of {sites.count} sites, number {missing[0]} has no point")
    if wrong := int((sites.label[label != DAMAGE] > 0).sum()):
        raise ArtefactError(f"label: {wrong} points in sites are not labelled DAMAGE")


def _check_surface(surface: Surface, get: Get) -> None:
    _require_faces(surface)


def _check_rims(rims: Rims, get: Get) -> None:
    surface: Surface = get("surface")
    if not rims.loops:
        raise ArtefactError("loops: there are none")
    for loop in rims.loops:
        require_index("loops", loop, len(surface.vertices), "vertices of the surface")
    steps = np.concatenate([_pair(loop, np.roll(loop, -1)) for loop in rims.loops])
    edges = _pair(surface.faces.reshape(-1), np.roll(surface.faces, -1, axis=1).reshape(-1))
    found, times = np.unique(edges, axis=0, return_counts=True)
    size = len(surface.vertices)
    if (~np.isin(steps @ [size, 1], found[times == 1] @ [size, 1])).any():
        raise ArtefactError("loops: not all steps follow edges that one triangle of the surface has")
    if len(np.unique(steps, axis=0)) < len(steps):
        raise ArtefactError("loops: an edge of the surface is used twice")


def _pair(one: Ints, other: Ints) -> Ints:
    """Edges (E,2) without direction."""
    return np.sort(np.column_stack([one, other]), axis=1)


def _check_enclosure(enclosure: Mesh, get: Get) -> None:
    _require_faces(enclosure)


def _check_enclosures(enclosures: Enclosures, get: Get) -> None:
    count = get("sites").count
    for item in enclosures.items:
        if max(item.sites) > count:
            raise ArtefactError(f"items: an enclosure names site {max(item.sites)}, but there are {count}")


def _check_damage(damage: Solid, get: Get) -> None:
    for name in ("solid", "part"):
        _require_within(f"the {'enclosure' if name == 'solid' else name}", damage, get(name))


def _check_deposit(deposit: Solid, get: Get) -> None:
    damage: Solid = get("damage")
    if not isinstance(deposit, Deposit):
        return
    for name, solid in (("deposit", deposit), ("cavity", deposit.cavity)):
        if solid is not None and solid.volume < damage.volume * (1 - SLACK):
            raise ArtefactError(
                f"the {name} has a volume of {solid.volume:.6g}, less than the damage volume, {damage.volume:.6g}, "
                "which it has to contain"
            )
    if deposit.touched or deposit.heights:
        known = get("part").faces_brep
        faces = set() if known is None else set(known.tolist())
        if other := {*deposit.touched, *(face for face, _ in deposit.heights)} - faces:
            raise ArtefactError(f"touched, heights: the part has no CAD face {min(other)}")


def _check_files(written: ExportedFiles | ReportFiles, get: Get) -> None:
    folder: Path = get("folder")
    for name in written.files:
        path = PurePosixPath(name)
        if path.is_absolute() or ".." in path.parts or not (folder / path).is_file():
            raise ArtefactError(f"files: {name!r} is not a file in the output folder")


CHECKS: Mapping[Contract, Callable[[Any, Get], None]] = {
    ReadPart: _check_part,
    ReadScan: _check_scan,
    Sample: _check_samples,
    Adapt: _check_adapted,
    Segment: _check_deviation,
    Cluster: _check_sites,
    Reconstruct: _check_surface,
    Boundary: _check_rims,
    Enclose: _check_enclosure,
    EncloseAll: _check_enclosures,
    Boolean: _check_damage,
    Allowance: _check_deposit,
    Export: _check_files,
    Report: _check_files,
}
"""By contract. Of the others, `Pose`, `Solid` and `DepositPath` check themselves all that a later stage relies on."""


def _require_unit(unit: str, get: Get) -> None:
    if unit != get("unit"):
        raise ArtefactError(f"unit: expected the job's unit, {get('unit')}, got {unit}")


def _require_faces(mesh: Mesh) -> None:
    if not len(mesh.faces):
        raise ArtefactError("faces: there are none")


def _require_within(name: str, inner: Solid, outer: Solid) -> None:
    """Raises ArtefactError where a solid is larger than one that has to contain it, or lies outside its bounds."""
    slack = SLACK * outer.diagonal
    if (inner.bounds[0] < outer.bounds[0] - slack).any() or (inner.bounds[1] > outer.bounds[1] + slack).any():
        raise ArtefactError(f"the damage volume reaches out of {name}")
    if inner.volume > outer.volume * (1 + SLACK):
        raise ArtefactError(f"the damage volume, {inner.volume:.6g}, is larger than {name}, {outer.volume:.6g}")
