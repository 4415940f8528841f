"""Spoiled files of every format: exit status 2 with a message, or a result; never a crash, a hang or 2 GB."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.faults import seeds
from tests.faults.mutations import KINDS, fix_pages
from tests.faults.run import GOOD, Row, Worker, fuzz, make_cases
from tests.needs import find_obstacle

NAMES = [
    name
    for name in [*seeds.SCANS, *seeds.PARTS, *seeds.JOBS]
    if name not in seeds.NATIVE or not find_obstacle("cadquery")
]


def describe_bad(rows: list[Row]) -> list[Row]:
    return [row for row in rows if row["outcome"] not in GOOD]


def test_sound_files_are_read(tmp_path: Path) -> None:
    """What the fuzzing spoils is right before."""
    seeds.write_others(tmp_path)
    worker = Worker()
    try:
        for name in NAMES:
            (tmp_path / name).write_bytes(seeds.seed(name))
            if name not in seeds.JOBS:
                (tmp_path / "job.yaml").write_text(seeds.make_job(name))
            row = worker.try_job(tmp_path / "job.yaml")
            assert row["outcome"] == "done", (name, row)
            assert row["points"] == seeds.POINTS
            assert row["volume"] == pytest.approx(24_000, rel=0.03)
    finally:
        worker.stop()


def test_spoiled_files_are_refused_or_read() -> None:
    rows = fuzz(200, names=[name for name in NAMES if name not in seeds.NATIVE])
    assert len(rows) == 200
    assert not describe_bad(rows)
    assert sum(row["outcome"] == "refused" for row in rows) > 100, "most of them are noticed"


@pytest.mark.slow
@pytest.mark.timeout(3000)
@pytest.mark.parametrize("mode", ["read", "run"])
def test_many_spoiled_files(mode: str) -> None:
    """``run``: the whole job, so that values that are read but extreme get to every stage."""
    assert not describe_bad(fuzz(2000 if mode == "read" else 400, seed=1, mode=mode, names=NAMES))


def test_the_same_seed_gives_the_same_files() -> None:
    names = ["part.stl", "job.yaml"]
    cases = list(make_cases(40, 3, names))
    assert cases == list(make_cases(40, 3, names))
    assert cases != list(make_cases(40, 4, names))
    assert {kind for _, kind, _ in cases} == set(KINDS)
    whole = seeds.seed("scan.e57")
    assert fix_pages(whole) == whole, "its checksums are those of the format"
