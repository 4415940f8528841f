"""A result's meshes as objects of trimesh and manifold3d, in both frames."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
import trimesh

from damageest.artefacts import Deposit
from damageest.output.site_json import index_files, report_site
from damageest.result import Result
from damageest.stages.export import ExportedFiles
from tests.stages.export import results


def test_trimesh_objects_are_the_meshes_and_their_own() -> None:
    result = results.make()
    for site in result.sites:
        for what in ("damage", "surface", "deposit"):
            found = result.as_trimesh(what, site.id)
            np.testing.assert_array_equal(found.vertices, site.mesh(what).vertices)
            np.testing.assert_array_equal(found.faces, site.mesh(what).faces)
            found.apply_scale(2)  # the caller's to change
            assert site.as_trimesh(what).bounds == pytest.approx(found.bounds / 2)
    assert result.sites[0].as_trimesh("deposit").volume == result.sites[0].as_trimesh("damage").volume
    for what, volume in (("part", 24000), ("damage", result.damage_volume), ("undamaged", result.undamaged_volume)):
        assert result.as_trimesh(what).is_watertight
        assert result.as_trimesh(what).volume == pytest.approx(volume)


def test_manifolds_have_the_volumes_and_can_be_computed_with() -> None:
    result = results.make()
    parts = [site.as_manifold("damage") for site in result.sites] + [result.as_manifold("undamaged")]
    whole = parts[0] + parts[1] + parts[2]
    assert whole.volume() == pytest.approx(24000, rel=1e-9)
    assert result.as_manifold("deposit", 2).volume() == pytest.approx(result.sites[1].as_trimesh("deposit").volume)


def test_the_scans_frame_undoes_the_pose() -> None:
    result = results.make()
    for what, site in (("undamaged", None), ("deposit", 2)):
        there = result.as_trimesh(what, site, frame="scan")
        assert np.abs(there.bounds - result.as_trimesh(what, site).bounds).max() > 10
        back = trimesh.transform_points(there.vertices, result.pose.T_part_scan)
        np.testing.assert_allclose(back, result.mesh(what, site).vertices, atol=1e-9)
        body = result.as_manifold(what, site, frame="scan")
        np.testing.assert_allclose(np.reshape(body.bounding_box(), (2, 3)), there.bounds, atol=1e-4)


def test_what_is_not_there_is_said_with_what_is() -> None:
    result = results.make()
    refused = replace(result.sites[0], refused=True)
    cases = [
        (lambda: result.as_trimesh("wear"), "has no 'wear'; there are: part, damage, undamaged"),
        (lambda: result.as_trimesh("part", 1), "site 1 has no 'part'; there are: damage, surface, deposit"),
        (lambda: result.as_trimesh("damage", 3), "no site 3; there are: 1, 2"),
        (lambda: result.as_trimesh("part", frame="world"), "no frame 'world'; there are: part, scan"),
        (lambda: result.as_manifold("surface", 1), "surface is an open mesh"),
        (lambda: refused.as_trimesh("deposit"), "site 1 has no deposit"),
        (lambda: results.without_damage().as_trimesh("damage"), "no damage: nothing is lost"),
        (lambda: replace(result, undamaged=None).as_manifold("undamaged"), "no undamaged: nothing is left"),
    ]
    for call, text in cases:
        with pytest.raises(ValueError, match=text):
            call()


def test_lost_metal_cut_back_and_stock_are_three_numbers(small_result: Result) -> None:
    """What `inner` takes off is part of the damage volume; what `prepare` takes off is beside it."""
    (site,) = small_result.sites
    assert small_result.describe_volumes() == ""
    assert small_result.lost_volume == pytest.approx(small_result.damage_volume)
    body = site.damage
    deposit = Deposit(body.vertices, body.faces, cavity=body, stock_volume=7.0, cut_back_volume=0.4 * body.volume)
    cut = replace(small_result, sites=(replace(site, deposit=deposit, accepted=True),))
    assert cut.lost_volume == pytest.approx(small_result.damage_volume - 0.4 * body.volume)
    assert (cut.cut_back_volume, cut.stock_volume) == (pytest.approx(0.4 * body.volume), 7.0)
    assert repr(cut).endswith(f"{cut.describe_volumes()}>")
    assert re.fullmatch(r"lost metal [0-9.]+ mm³, cut-back [0-9.]+ mm³, stock 7 mm³", cut.describe_volumes())
    opened = replace(small_result, sites=(replace(site, deposit=replace(deposit, milled=body), accepted=True),))
    assert opened.lost_volume == pytest.approx(small_result.damage_volume)


def test_a_file_that_others_may_refuse_is_listed_and_is_not_the_sites_solid(small_result: Result) -> None:
    (site,) = small_result.sites
    names = [f"damage/site-{site.id}-invalid.step", f"surface/site-{site.id}.ply"]
    told = report_site(site, ExportedFiles(tuple(names)), index_files(names)).files
    assert (told.damage, told.surface) == (None, names[1])
    assert told.every == names
