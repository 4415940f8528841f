"""Steps for what lies outside the nominal surface: what it is, its volume, and the sites beside it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from damageest.artefacts import ADDED, DAMAGE, Deviation, Floats, Reason, Sites
from damageest.errors import DamageestError, StageError
from damageest.findings import Surplus
from damageest.geometry.alike import have_same_shape
from damageest.geometry.complement import complement_deviation, complement_part, complement_samples, label_strays
from damageest.geometry.pieces import JoinedPieces, find_pieces, join_pieces
from damageest.geometry.scan_field import ScanField
from damageest.geometry.solids import to_manifold, to_solid
from damageest.geometry.threads import count_threads
from damageest.pipeline.engine import Engine
from damageest.pipeline.finding.sites import find_place
from damageest.pipeline.near_damage import sample_near_damage
from damageest.pipeline.state import FoundSite, JobState, Reasons
from damageest.pipeline.steps import step
from damageest.stages.cluster import Cluster
from damageest.stages.enclose import EncloseAll
from damageest.trust.surplus import close_surplus, compare_with_losses, describe_surplus, join_surplus
from damageest.trust.views.two_sheets import EXPLAINED, FARTHEST

MARGIN = 80.0
"""Distance in tolerances between the surplus and the sides of the complement's box; more than an enclosure needs."""
MOST_CLOSED = 16
"""Number of surplus clusters, largest first, whose volume is computed; of the others it is estimated."""
FEW, FEW_SHARE = 30, 0.001
"""Points, and share of the scan, below both of which a cluster is too small for more than an estimate of its volume: at
the edge of what was seen it may be joined with skin that was not."""
SHALLOW = 2.0
"""Height in tolerances below which a surplus is a layer, as of paint: its area times its mean height is its volume."""
MOST_SKIN = 0.5
"""Share of the part's skin from which surplus is an error of the pose, of the unit or of the tolerance."""
EQUAL, EQUAL_TOUCHING = 1.35, 1.1
"""Largest ratio of the volumes of a displaced piece and of the place that it left; the second for surplus that touches
the loss, and may be a weld bead on it."""


@step(gives=("surplus", "deviation", "warnings"), reads=("unit", "sheets", "field"), calls=(Cluster, EncloseAll))
def find_surplus(engine: Engine, state: JobState) -> tuple[tuple[Surplus, ...], Deviation, Reasons]:
    """Finds added metal and surroundings, and the volume of the former.

    A surplus is a loss of the part's complement: the job's implementations of `cluster` and `enclose` are called on
    that. Points outside the skin that are in no cluster, or in surroundings, become outliers in the deviation, so that
    they do not count as metal on the skin. Where a stage fails, the sites are found all the same.
    """
    if not (state.deviation.label == ADDED).any():
        return (), state.deviation, ()
    turned = state.with_value(JobState.deviation, complement_deviation(state.deviation))
    own = engine.make_silent(EncloseAll)
    try:
        clusters = own.call(Cluster, turned).sites
    except StageError as error:
        warning = Reason("surplus", f"points outside the nominal surface could not be grouped: {error}")
        return (), state.deviation, [warning]
    found = describe_surplus(clusters, state.sites, state.field)
    kept = _keep_metal(clusters, found)
    deviation = label_strays(state.deviation, ADDED, kept)
    surplus = _close(own, turned, found, kept, _choose_layer(state, found)) if kept.count else found
    surplus = tuple(replace(item, id=number) for number, item in enumerate(_sort(surplus), 1))
    return surplus, deviation, ()


@step(gives=("surplus", "found", "warnings"))
def relate_surplus(
    surplus: tuple[Surplus, ...], found: tuple[FoundSite, ...], field: ScanField, unit: str
) -> tuple[tuple[Surplus, ...], tuple[FoundSite, ...], Reasons]:
    """Names the surplus beside each site, and says what is to be done about surroundings."""
    sites, done = list(found), []
    warnings: list[Reason] = []
    reach = max(2 * field.tolerance, 1.5 * field.aligned.spacing)
    for item in surplus:
        beside = [site for site in sites if set(site.clusters) & set(item.clusters)]
        item = compare_with_losses(item, [site.damage.volume for site in beside])
        done.append(item)
        if item.kind == "surroundings":
            continue
        touching = {site.number for site in beside if _is_touching(field.points, item, site, reach)}
        twins = {site.number for site in sites if site not in beside and _is_twin(item, site)}
        sites = [replace(s, twins=(*s.twins, item.id)) if s.number in twins else s for s in sites]
        covered = (item.id, item.area)
        sites = [replace(s, covered=(*s.covered, covered)) if s.number in touching else s for s in sites]
        if item.kind == "displaced piece":
            of = " and ".join(f"site {site.number} ({site.damage.volume:.3g} {unit}³)" for site in beside)
            own = "" if item.volume is None else f" ({item.volume:.3g} {unit}³)"
            volumes = [other.damage.volume for other in beside]
            equal = {
                site.number
                for site in beside
                if _is_equal(
                    item,
                    (site.damage.volume, sum(volumes)),
                    EQUAL_TOUCHING if site.number in touching else EQUAL,
                )
            }
            sites = [replace(s, displaced=(*s.displaced, item.id)) if s.number in equal else s for s in sites]
            text = f"surplus {item.id}{own} may be a displaced piece" + (f" of {of}" if of else "")
            remedy = "put it back and scan again, or repair the part as if the piece were lost"
            place = find_place(field.points, item.points)
            warnings.append(
                Reason("displaced_piece", text, amount=item.volume, unit=f"{unit}³", place=place, remedy=remedy)
            )
    if outside := [item for item in done if item.kind == "surroundings"]:
        names = "; ".join(f"surplus {item.id}: {item.notes[0]}" for item in outside[:5])
        share = sum(item.share for item in outside)
        text = f"removed {share:.1%} of the scan: not part of the part ({names})"
        remedy = "crop the scan to be sure: scan: {crop: ...}"
        warnings.append(Reason("surroundings", text, amount=share, remedy=remedy))
    return tuple(done), tuple(sites), warnings


def _is_equal(item: Surplus, volumes: tuple[float, ...], most: float) -> bool:
    """Whether the volume of a surplus is one of the given volumes, within a factor ``most``."""
    return item.volume is not None and any(1 / most < volume / item.volume < most for volume in volumes)


def _is_twin(item: Surplus, site: FoundSite) -> bool:
    """Whether a surplus has the shape of a loss that lies elsewhere."""
    return item.solid is not None and have_same_shape(item.solid, site.damage)


def _is_touching(points: Floats, item: Surplus, site: FoundSite, reach: float) -> bool:
    from scipy.spatial import cKDTree

    gap = cKDTree(points[item.points]).query(points[site.members], distance_upper_bound=reach, workers=count_threads())[
        0
    ]
    return bool(np.isfinite(gap).any())


def _keep_metal(clusters: Sites, found: tuple[Surplus, ...]) -> Sites:
    """The clusters that are not surroundings, numbered anew."""
    number = np.zeros(clusters.count + 1, np.int32)
    kept = [item.id for item in found if item.kind != "surroundings"]
    number[kept] = np.arange(1, len(kept) + 1)
    return Sites(number[clusters.label], len(kept))


def _close(engine: Engine, turned: JobState, found: tuple[Surplus, ...], kept: Sites, layer: float) -> list[Surplus]:
    """The surplus with solids where they close; ``turned`` is the state of the part's complement. What is lower than a
    ``layer`` is not closed."""
    metal = [item for item in found if item.kind != "surroundings"]
    done = [item for item in found if item.kind == "surroundings"]
    if sum(item.area for item in metal) > MOST_SKIN * turned.part.area:
        note = "surplus covers most of the part: check pose, unit and tolerance; its volume was not computed"
        return done + [replace(item, notes=(*item.notes, note)) for item in metal]
    open_ = {number: _describe_why_open(item, layer) for number, item in enumerate(metal, 1)}
    closed = [number for number, why in open_.items() if not why]
    # the numbers of the clusters that are closed, in the order of their own numbers below
    tried = sorted(closed, key=lambda number: -metal[number - 1].estimate)[:MOST_CLOSED]
    renumbered = np.zeros(kept.count + 1, np.int32)
    renumbered[tried] = np.arange(1, len(tried) + 1)
    reason, pieces = "no closed surface could be reconstructed through its points", []
    try:
        pieces = _enclose(engine, turned, Sites(renumbered[kept.label], len(tried))) if tried else []
    except (DamageestError, ValueError) as error:
        reason = str(error)
    left = dict(enumerate(metal, 1))
    for piece in pieces:
        own = {tried[number - 1] for number in piece.clusters}
        item = join_surplus([metal[number - 1] for number in sorted(own)])
        solid = close_surplus(item, piece.damage, turned.field, turned.unit)
        if solid is not None:
            done.append(solid)
            left = {number: other for number, other in left.items() if number not in own}
    for number, item in left.items():
        why = open_[number] or (reason if number in tried else f"only the {MOST_CLOSED} largest are closed")
        done.append(replace(item, notes=(*item.notes, f"its volume was not computed: {why}")))
    return done


def _choose_layer(state: JobState, found: tuple[Surplus, ...]) -> float:
    """Height below which a surplus is a layer. Where views lie apart, one of them is up to that far outside the skin,
    over much of it: to close such layers costs more than all the rest of a run."""
    layer, sheets = SHALLOW * state.tolerance, state.sheets
    if not sheets.disagree or not any(layer <= item.height < FARTHEST * state.tolerance for item in found):
        return layer
    return max(layer, EXPLAINED * sheets.apart)


def _describe_why_open(item: Surplus, layer: float) -> str:
    """Why no more than an estimate is asked of a surplus; empty where it is to be closed."""
    if len(item.points) < FEW and item.share < FEW_SHARE:
        return f"it has {len(item.points)} points"
    return f"it is a layer lower than {layer:.3g}" if item.height < layer else ""


def _enclose(engine: Engine, turned: JobState, kept: Sites) -> list[JoinedPieces]:
    """Volumes outside the part, and the clusters that bound each."""
    part, points, label = turned.part, turned.aligned.points, kept.label
    members = np.flatnonzero(label)
    deviation = label_strays(turned.deviation, DAMAGE, kept)
    box = complement_part(part, points[members], MARGIN * turned.tolerance)
    state = turned.with_value(JobState.part, box).with_value(JobState.deviation, deviation)
    state = state.with_value(JobState.sites, kept)
    if "samples" in engine.needs(EncloseAll):
        samples = engine.fill(("samples",), turned).samples
        assert samples is not None
        state = state.with_value(JobState.samples, complement_samples(samples))
    encloser = engine.job.stages[EncloseAll]
    assert isinstance(encloser, EncloseAll)  # as it is called below
    nearby = sample_near_damage(replace(turned.field, deviation=deviation), kept, encloser)
    state = state.with_value(JobState.nearby, complement_samples(nearby))
    origin = part.bounds.mean(axis=0)
    whole = to_manifold(part, origin)
    reach = max(2 * turned.tolerance, turned.aligned.spacing)
    pieces = []
    for enclosure in engine.call(EncloseAll, state).enclosures.items:
        outside = to_solid(to_manifold(enclosure.solid, origin) - whole, origin)
        if outside is not None:
            pieces += find_pieces(outside, points[members], label[members], reach)[0]
    return join_pieces(pieces)


def _sort(items: Sequence[Surplus]) -> list[Surplus]:
    """Largest volume first; then what has none, by its estimate, surroundings last."""
    return sorted(
        items, key=lambda item: (item.kind == "surroundings", -(item.volume or 0.0), -item.estimate, -item.share)
    )
