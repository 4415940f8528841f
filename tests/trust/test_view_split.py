"""Views that a scan does not name are told apart where they lie apart, and only there."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from damageest_benchmarks.parts import PARTS
from scipy.spatial.transform import Rotation

import damageest
from damageest.artefacts import Floats, Scan
from damageest.geometry.distance import distance_to_mesh
from damageest.stages.scan.simulate import Simulate
from damageest.trust.views.view_fit import fit_views
from damageest.trust.views.view_split import separate_views
from tests.trust.form_scenes import NOISE, TOLERANCE, add_noise, draw_skin, get_part

SCANNERS = np.array([(1.0, 0.3, 1.0), (-0.8, 0.5, 1.0), (0.1, -1.0, 0.9)])


def scan_part(
    name: str, move: Floats | None = None, order: str = "views", wear: float = 0.0, count: int = 30_000
) -> tuple[Scan, Floats]:
    """A scan from three sides, the second view moved by ``move`` (4,4), and the view of each point. ``order`` of the
    points: one view after the other, `shuffled`, or `swept` across the part. ``wear`` of the top, in tolerances."""
    points, normals = draw_skin(name, count)
    facing = normals @ SCANNERS.T
    seen = facing.max(axis=1) > 0.15
    points, normals, facing = points[seen], normals[seen], facing[seen]
    rng = np.random.default_rng(5)
    view = np.argmax((facing > 0.15) * rng.random(facing.shape), axis=1)
    points = points - wear * TOLERANCE * (normals[:, 2] > 0.9)[:, None] * np.array([0.0, 0.0, 1.0])
    if move is not None:
        moved = points @ move[:3, :3].T + move[:3, 3]
        points = np.where((view == 1)[:, None], moved, points)
    points = add_noise(points)
    turn = {
        "views": np.lexsort((rng.random(len(view)), view)),
        "shuffled": rng.permutation(len(view)),
        "swept": np.argsort(points @ np.array([1.0, 0.02, 0.01])),
    }[order]
    return Scan(points[turn], noise=NOISE, spacing=0.8), view[turn]


def deepen(amount: float, turn: float = 0.0) -> Floats:
    """The motion of a view that lies ``amount`` tolerances too deep, turned by some degrees."""
    T = np.eye(4)
    T[:3, :3] = Rotation.from_rotvec(np.radians(turn) * np.array([0.6, 0.0, 0.8])).as_matrix()
    T[:3, 3] = -amount * TOLERANCE * SCANNERS[1] / np.linalg.norm(SCANNERS[1])
    return T


@pytest.mark.variants(1)
@pytest.mark.parametrize("name", ["rib_bracket", "lever"])
@pytest.mark.parametrize(("amount", "turn"), [(1.5, 0.0), (0.0, 0.5)])
def test_views_one_after_the_other_are_told_apart_and_put_right(name: str, amount: float, turn: float) -> None:
    scan, view = scan_part(name, deepen(amount, turn))
    found = separate_views(get_part(name), scan, TOLERANCE)
    assert found is not None
    label, by = found
    assert by == "order"
    ends = [np.bincount(label[view == number]).argmax() for number in range(3)]
    assert ends[1] not in (ends[0], ends[2])
    told = (label == ends[1]) == (view == 1)
    assert told.mean() > 0.995
    fits = fit_views(get_part(name), scan, TOLERANCE, True, label, by)
    assert fits is not None
    assert [one.number for one in fits.views if one.is_corrected] == [ends[1]]
    off = distance_to_mesh(fits.apply(scan).points, get_part(name)) > TOLERANCE
    assert off.mean() < 0.002


def test_two_surfaces_over_the_same_skin_are_told_in_any_order() -> None:
    scan, view = scan_part("lever", deepen(2.0), "shuffled")
    found = separate_views(get_part("lever"), scan, TOLERANCE)
    assert found is not None
    label, by = found
    assert by == "sheets"
    told = label >= 0
    assert told.mean() > 0.3
    assert ((label == 1) == (view == 1))[told].mean() > 0.9


@pytest.mark.variants(6)
@pytest.mark.parametrize("name", ["rib_bracket", "cuboid", "gear"])
@pytest.mark.parametrize("order", ["views", "shuffled", "swept"])
@pytest.mark.parametrize("wear", [0.0, 2.0])
def test_views_that_agree_are_one_also_on_worn_skin(name: str, order: str, wear: float) -> None:
    scan, _ = scan_part(name, None, order, wear)
    assert separate_views(get_part(name), scan, TOLERANCE) is None


def test_a_scan_that_names_its_views_is_not_separated() -> None:
    scan, view = scan_part("lever", deepen(1.5))
    assert separate_views(get_part("lever"), replace(scan, cloud=view.astype(np.int32)), TOLERANCE) is None


@pytest.mark.slow
def test_a_misplaced_view_in_one_file_gives_no_accepted_site() -> None:
    """Left where they are, as a given pose asks for, views that do not fit make every false site doubtful; registered,
    they are moved, and no site is left."""
    scan, _ = scan_part("rib_bracket", deepen(1.5), count=15_000)
    job = {"version": 1, "tolerance": TOLERANCE, "report": "none"}
    left = damageest.run(job | {"align": "none"}, part=get_part("rib_bracket"), scan=Scan(scan.points))
    assert left.sites
    assert not any(site.accepted for site in left.sites)
    assert "misplaced_view" in {reason.code for site in left.sites for reason in site.verdict.reasons}
    moved = damageest.run(job, part=get_part("rib_bracket"), scan=Scan(scan.points))
    assert not any(site.accepted for site in moved.sites)
    assert moved.fit is not None
    assert moved.fit.views_from == "order"
    assert any(view.is_corrected for view in moved.fit.views)
    assert sum(site.damage.volume for site in moved.sites) < 0.1 * sum(site.damage.volume for site in left.sites)


@pytest.mark.slow
def test_views_that_two_surfaces_tell_apart_give_no_site_and_one_line() -> None:
    """They are not moved, since one of them alone shows much of the skin: what it shows too deep is told, and stays in
    the total's high end."""
    scan, _ = scan_part("lever", deepen(2.0), "shuffled", count=12_000)
    job = {"version": 1, "tolerance": TOLERANCE, "report": "none"}
    result = damageest.run(job, part=get_part("lever"), scan=Scan(scan.points))
    assert not result.sites
    assert result.fit is not None
    assert result.fit.views_from == "sheets"
    assert not any(view.is_corrected for view in result.fit.views)
    (told,) = [note for note in result.warnings if note.code == "below_noise"]
    assert "two surfaces" in told.text
    assert told.amount


@pytest.mark.slow
def test_a_loss_under_views_that_lie_apart_stays_a_site() -> None:
    """It is in one cluster with the skin of a view that lies too deep, and deeper than that explains."""
    part = PARTS["ribbed_plate"]()
    loss = {"tool": "blob", "centre": [-20, -26, 17], "radius": 7, "seed": 5}
    simulate = {"points": 40_000, "noise": 0.04, "seed": 7, "scanners": [[-150, -250, 300], [200, 250, 300]]}
    scan = Simulate.model_validate(simulate | {"misplaced": 0.5, "damage": [loss], "pose": "random"}).run(
        part.unit, part
    )
    job = {"version": 1, "tolerance": 0.25, "report": "none"}
    result = damageest.run(job, part=part, scan=Scan(scan.points))
    assert result.sites
    assert max(site.max_depth for site in result.sites) > 1
    assert "below_noise" in {note.code for note in result.warnings}
    assert result.fit is not None
    assert result.fit.model != "ok"
