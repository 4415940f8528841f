from __future__ import annotations

import pytest
from damageest_evaluate.variants import Baseline, VariationRequest, make_variants

from damageest.errors import InputError

MINE = Baseline("mm", {"noise": 0.02, "points": 5000}, 0.1, False, False, {"cluster": "dbscan"})
SUITE = Baseline("mm", {"noise": 0.05, "points": 5000}, 0.2, False, True)


def test_nothing_varied_is_one_variant() -> None:
    (only,) = make_variants(VariationRequest(), MINE)
    assert (only.varied, only.size, only.scanner, only.settings) == ({}, None, MINE.scanner, ("tolerance=0.1",))


def test_lengths_are_in_the_unit_of_the_job_or_their_own_or_multiples() -> None:
    sizes = [way.size for way in make_variants(VariationRequest(size="0,0.3,4x,500um,0.1in"), MINE)]
    assert sizes == pytest.approx([0, 0.3, 0.4, 0.5, 2.54])
    noises = [way.scanner["noise"] for way in make_variants(VariationRequest(noise="0.5,2x,0.03mm"), MINE)]
    assert noises == pytest.approx([0.01, 0.04, 0.03])
    tolerances = make_variants(VariationRequest(tolerance="0.3,2x,auto"), MINE)
    assert [way.settings[-1] for way in tolerances] == ["tolerance=0.3", "tolerance=0.2", 'tolerance="auto"']
    assert [way.tolerance for way in tolerances] == pytest.approx([0.3, 0.2, 0.08])


def test_for_several_parts_tolerances_follow_the_noise_and_labels_are_multiples() -> None:
    ways = make_variants(VariationRequest(noise="1,2", tolerance="4,6"), SUITE)
    assert [way.varied for way in ways] == [
        {"noise": noise, "tolerance": tolerance} for noise in (1, 2) for tolerance in (4, 6)
    ]
    assert [way.tolerance for way in ways] == pytest.approx([0.2, 0.3, 0.4, 0.6])


def test_all_combinations_of_options_and_implementations() -> None:
    ways = make_variants(
        VariationRequest(vary=["cluster.use=dbscan,other", "scan.outliers=0,0.1"], settings=["method=auto"]), MINE
    )
    assert [way.varied for way in ways] == [
        {"cluster": use, "scan.outliers": share} for use in ("dbscan", "other") for share in (0, 0.1)
    ]
    assert [way.scanner["outliers"] for way in ways] == [0, 0.1, 0, 0.1]
    # the job's own implementation stays with the options that the job gives it
    assert ways[0].settings == ("method=auto", "tolerance=0.1")
    assert ways[2].settings == ("method=auto", "tolerance=0.1", 'cluster="other"')


def test_ways_to_compare_are_settings_beside_the_jobs_own() -> None:
    rival = "method=octree enclose.depth=8"
    ways = make_variants(VariationRequest(tolerance="0.1,0.2", against=[rival, rival], settings=["method=auto"]), MINE)
    assert [way.varied for way in ways] == [
        {"tolerance": tolerance, "way": name} for tolerance in (0.1, 0.2) for name in ("default", rival)
    ]
    assert ways[0].settings == ("method=auto", "tolerance=0.1")
    assert ways[1].settings == ("method=auto", "tolerance=0.1", "method=octree", "enclose.depth=8")


def test_values_may_be_lists() -> None:
    ways = make_variants(VariationRequest(vary=["background.size=[1,2,3],[4,5,6]"]), MINE)
    assert [way.settings[-1] for way in ways] == ["background.size=[1, 2, 3]", "background.size=[4, 5, 6]"]


@pytest.mark.parametrize(
    ("wanted", "said"),
    [
        (VariationRequest(noise="1,much"), "--noise: 'much' is not a length"),
        (VariationRequest(size="0.4parsec"), "unknown unit 'parsec'"),
        (VariationRequest(points="0"), "--points"),
        (VariationRequest(tolerance="0"), "--tolerance: '0' is not above 0"),
        (VariationRequest(vary=["cluster.eps"]), "--vary cluster.eps: not valid; give stage.option=a,b,c"),
        (VariationRequest(vary=["scan.noise=0.1,0.2"]), "use the option --noise 0.1,0.2"),
        (VariationRequest(vary=["scan.damage=1"]), "--vary scan.damage: cannot be varied"),
        (VariationRequest(vary=["part.unit=mm,cm"]), "--vary part.unit: cannot be varied"),
        (VariationRequest(vary=["method=auto", "method=surface"]), "'method' is given twice"),
    ],
)
def test_faults_are_named(wanted: VariationRequest, said: str) -> None:
    with pytest.raises(InputError) as caught:
        make_variants(wanted, MINE)
    assert said in str(caught.value)


def test_multiples_of_no_noise_are_refused() -> None:
    with pytest.raises(InputError, match=r"multiple of 0; give a length with its unit, for example 0\.01mm"):
        make_variants(VariationRequest(noise="1,2"), Baseline("mm", {"noise": 0.0, "points": 10}, 0.1, False, False))
