"""Spoiled files of every format: exit status 2 with a message, or a result; never a crash, a hang or 2 GB."""

from __future__ import annotations

import random
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from damageest.job import load
from damageest.pipeline.begin import start
from damageest.pipeline.engine import Engine, follow
from damageest.pipeline.placing.prepare import place_scan
from damageest.pipeline.routes import route_of
from damageest.registry import Registry
from tests.faults import others, seeds
from tests.faults.mutations import KINDS, fix_pages, spoil
from tests.faults.run import GOOD, NAMES, Case, Row, Worker, find_seed, fuzz, make_cases, make_earlier, write_case
from tests.needs import find_obstacle

HERE = [name for name in NAMES if not (name.endswith(seeds.NATIVE) and find_obstacle("cadquery"))]
QUICK = [name for name in HERE if not name.endswith(seeds.NATIVE)]


def describe_bad(rows: list[Row]) -> list[Row]:
    return [row for row in rows if row["outcome"] not in GOOD]


@pytest.fixture(scope="module")
def worker(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Worker]:
    one = Worker()
    seeds.write_others(folder := tmp_path_factory.mktemp("first"))
    make_earlier(folder, one)  # the first run loads what all need
    yield one
    one.stop()


@pytest.mark.variants(37)
@pytest.mark.parametrize("name", [pytest.param(one, marks=() if one in QUICK else pytest.mark.slow) for one in HERE])
def test_sound_files_are_read(name: str, worker: Worker, tmp_path: Path) -> None:
    """What the fuzzing spoils is right before."""
    seeds.write_others(tmp_path)
    row = worker.try_job(write_case(tmp_path, Case(name, "", find_seed(name))))
    assert row["outcome"] == "done", row
    if name not in others.FILES:
        assert row["points"] == (len(seeds.dense()) if name == "datums.yaml" else seeds.POINTS)
        assert row["volume"] == pytest.approx(24_000, rel=0.03)


def check_spoiled(count: int, whole: float, worker: Worker) -> None:
    """Of the jobs a few are run to their end, over an earlier output."""
    rows = fuzz(count, whole=whole, names=QUICK, worker=worker)
    assert len(rows) == count
    assert not describe_bad(rows)
    assert sum(row["outcome"] == "refused" for row in rows) > count / 2, "most of them are noticed"
    assert any(row["whole"] for row in rows)


@pytest.mark.slow
def test_spoiled_files_are_refused_or_read(worker: Worker) -> None:
    check_spoiled(len(QUICK), 0.06, worker)


@pytest.mark.slow
def test_more_spoiled_files_are_refused_or_read(worker: Worker) -> None:
    check_spoiled(500, 0.03, worker)


@pytest.mark.nightly
@pytest.mark.timeout(3000)
def test_many_spoiled_files() -> None:
    """A third of the jobs is run to the end, so that values that are read but extreme get to every stage."""
    assert not describe_bad(fuzz(2000, seed=1, whole=0.3, names=HERE))


def test_the_same_seed_gives_the_same_files() -> None:
    names = ["part.stl", "job.yaml"]
    cases = list(make_cases(40, 3, names))
    assert cases == list(make_cases(40, 3, names))
    assert cases != list(make_cases(40, 4, names))
    assert {case.kind for case in cases} == set(KINDS)
    whole = seeds.seed("scan.e57")
    assert fix_pages(whole) == whole, "its checksums are those of the format"


@pytest.mark.parametrize(
    ("name", "kind", "seed"),
    [
        pytest.param("binary.pcd", "splice", "0/binary.pcd/94", marks=pytest.mark.slow),
        ("adapt.npz", "inside", "0/adapt.npz/5935"),
    ],
)
def test_what_failed_once_is_refused(name: str, kind: str, seed: str, worker: Worker, tmp_path: Path) -> None:
    """Found among 10,000: a scan without a clear normal in a given pose, an array whose header is no Python."""
    seeds.write_others(tmp_path)
    case = Case(name, kind, spoil(find_seed(name), name, kind, random.Random(seed)))
    row = worker.try_job(write_case(tmp_path, case), "run")
    assert row["outcome"] in GOOD, row


@pytest.mark.slow
def test_a_scan_without_a_clear_normal_is_placed_as_given(tmp_path: Path, registry: Registry) -> None:
    """The scan of the first one above, as far as it failed."""
    seeds.write_others(tmp_path)
    data = spoil(find_seed("binary.pcd"), "binary.pcd", "splice", random.Random("0/binary.pcd/94"))
    job = load(write_case(tmp_path, Case("binary.pcd", "splice", data)), registry, ["report=none"])
    engine, route = Engine(job, registry), route_of(job.method)
    state = follow(route[: route.index(place_scan)], engine, start(engine))
    assert np.array_equal(state.pose.T_part_scan, np.eye(4))
