"""What tests cost: children count, shared fixtures do not, and a test that is dear twice is named."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import damageest
from damageest.result import Result
from tests import costs, damaged_box

BURN = "import time\nend = time.process_time() + {}\nwhile time.process_time() < end: pass\n"


def test_seconds_of_children_count_while_they_live_and_after() -> None:
    before = costs.count_processor_seconds()
    code = BURN.format(0.2) + "print('there', flush=True)\ninput()"
    with subprocess.Popen(
        [sys.executable, "-c", code], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as child:
        assert child.stdout
        child.stdout.readline()
        living = costs.count_processor_seconds() - before
        child.communicate("\n")
    assert 0.19 <= living <= costs.count_processor_seconds() - before + 0.02


TESTS = """
import time
import pytest

def burn(seconds):
    end = time.process_time() + seconds
    while time.process_time() < end: pass

@pytest.fixture(scope="module")
def shared():
    burn(0.4)

def test_cheap(shared): pass
def test_dear(): burn(0.4)
@pytest.mark.slow
def test_slow(): burn(0.4)
"""


def test_slow_tests_that_take_long_are_nightly(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Those that were not run stay as they were."""
    monkeypatch.setattr(costs, "NIGHTLY", tmp_path / "nightly.txt")
    assert costs.read_nightly() == set()
    costs.note_nightly({"a.py::long": 9.0, "a.py::short": 1.0, "tests/test_jobs.py::example": 60.0})
    assert costs.read_nightly() == {"a.py::long"}
    costs.note_nightly({"b.py::long": 6.0, "c.py::short": 0.1})
    assert costs.read_nightly() == {"a.py::long", "b.py::long"}
    costs.note_nightly({"a.py::long": 4.0})
    assert costs.read_nightly() == {"b.py::long"}


def test_nightly_tests_are_there() -> None:
    """A test that was renamed is slow again, unless its new name is noted."""
    root = Path(__file__).parents[1]
    shared = "".join(path.read_text() for path in (root / "damageest/conformance").glob("*.py"))
    listed = sorted({tuple(name.partition("[")[0].split("::")) for name in costs.read_nightly()})
    assert len(listed) > 40
    for path, *names in listed:
        assert f"def {names[-1]}(" in (root / path).read_text() + shared, f"{path}: {names[-1]}"


@pytest.mark.slow
@pytest.mark.parametrize(("most", "status"), [(0.15, 1), (0.6, 0)])
def test_a_dear_test_fails_the_run_the_second_time(most: float, status: int, tmp_path: Path) -> None:
    (tmp_path / "tests").mkdir()
    (tmp_path / "tests/__init__.py").touch()
    shutil.copy(costs.__file__, tmp_path / "tests/costs.py")
    source = (tmp_path / "tests/costs.py").read_text().replace("MOST = 2.0", f"MOST = {most}")
    (tmp_path / "tests/costs.py").write_text(source.replace("'--no-cov', ", ""))
    (tmp_path / "conftest.py").write_text('pytest_plugins = ["tests.costs"]\n')
    (tmp_path / "pytest.ini").write_text("[pytest]\nmarkers = slow: of no matter\n")
    (tmp_path / "test_some.py").write_text(TESTS)
    words = [sys.executable, "-m", "pytest", "-q", "-n", "1", "--dear-fails", "-p", "no:cacheprovider", "test_some.py"]
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == status, done.stdout + done.stderr
    told = [line for line in done.stdout.splitlines() if "twice" in line]
    assert [line.split()[0] for line in told] == ["test_some.py::test_dear"] * status


@pytest.mark.slow
def test_the_finished_folder_is_as_one_that_has_just_been_made(small_done: Path, small_result: Result) -> None:
    """No stage runs again, and the volume is right."""
    assert small_result.damage_volume == pytest.approx(damaged_box.TRUE_VOLUME, rel=0.03)
    again = damageest.run(small_done, output=True)
    assert {record.stage for record in again.stages if not record.cached} <= {"export", "report"}
    assert json.loads((small_done.parent / "out/job/result.json").read_text())["damage_volume"] == again.damage_volume
