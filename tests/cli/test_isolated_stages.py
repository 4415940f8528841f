"""A plugin's stage that crashes, exits, hangs or takes all memory: named, exit status 1, the earlier output intact."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

import damageest
from damageest.errors import StageError
from damageest.isolation import Limits, end_workers
from damageest.result import Result
from tests import damaged_box
from tests.cli.calls import call
from tests.registry.test_registry import GROWN, Site, site

__all__ = ["site"]
ALIGN = '''
from damageest.artefacts import Part, Pose, Scan
from damageest.stages.align import Align

class Faulty(Align):
    """As native libraries are at times."""
    isolated = True
    use: Literal["faulty"] = "faulty"
    def run(self, scan: Scan, part: Part, tolerance: float) -> Pose:
        BODY

@hookimpl
def damageest_stages():
    return [Faulty]
'''
FAULTS = {
    "segmentation fault": ("import ctypes; ctypes.string_at(0)", "ended by a segmentation fault (SIGSEGV)"),
    "abort": ("import os; os.abort()", "ended by an abort (SIGABRT)"),
    "exit at once": ("import os; os._exit(0)", "ended its process with exit status 0"),
    "memory": ("import numpy as np; np.ones(30 * 10**9 // 8)", "that --memory leaves it"),
    "hang": ("import time; time.sleep(600)", "not finished after 0.5 s, the time limit of a stage"),
}
ONCE = '''
from pathlib import Path
from damageest.artefacts import Part, Solid
from damageest.stages.boolean import Boolean
from damageest.stages.boolean.manifold import Manifold

class Once(Boolean):
    """Crashes once."""
    isolated = True
    use: Literal["once"] = "once"
    mark: str
    def run(self, solid: Solid, part: Part) -> Solid | None:
        import os
        if not Path(self.mark).exists():
            Path(self.mark).touch()
            os.abort()
        print("hello")
        return Manifold().run(solid, part)

@hookimpl
def damageest_stages():
    return [Once]
'''


@pytest.fixture(autouse=True)
def _end() -> Iterator[None]:
    yield
    end_workers()


@pytest.mark.parametrize(
    "name",
    [name if name in ("memory", "hang") else pytest.param(name, marks=pytest.mark.slow) for name in FAULTS],
)
def test_each_fault_is_the_stages_own(name: str, site: Site, small_done: Path) -> None:
    """From Python."""
    body, text = FAULTS[name]
    output = small_done.parent / "out/job"
    before = damaged_box.content(output)
    site.add("acme-bad", ALIGN.replace("BODY", body))
    limits = Limits(4 * 10**9, 0.5 if name == "hang" else 60)
    with pytest.raises(StageError) as caught:
        damageest.run(small_done, output=True, settings=["align=faulty"], limits=limits)
    assert text in caught.value.message
    assert str(caught.value).startswith("align: faulty: ")
    assert "acme-bad 1.2" in caught.value.remedy or name == "memory"
    after = damaged_box.content(output)
    assert {file: after[file] for file in before} == before


@pytest.mark.slow
def test_a_hang_on_the_command_line(site: Site, small_done: Path) -> None:
    site.add("acme-bad", ALIGN.replace("BODY", "while True: pass"))
    status, said = call("run", small_done, "--set", "align=faulty", "--stage-timeout", "0.5")
    assert status == 1
    assert "align: faulty: was ended: not finished after 0.5 s" in " ".join(said.split())
    assert "  align: faulty  " in said, "the stage is named when it begins"
    assert "acme-bad 1.2" in said


@pytest.mark.slow
def test_sys_exit_in_a_stage_without_a_process_of_its_own(site: Site, small_done: Path) -> None:
    body = "return Solid(damage.vertices * self.factor, damage.faces)"
    site.add("acme-bad", GROWN.replace(body, "import sys; sys.exit(0)"))
    result = damageest.run(small_done, settings=["allowance=doubled"], output=True)
    assert any("allowance: doubled (site 1): called sys.exit(0)" in text for text in result.failures)
    assert "acme-bad 1.2" in " ".join(result.failures)


@pytest.mark.slow
def test_method_auto_goes_on_after_a_crash(site: Site, small_done: Path, tmp_path: Path) -> None:
    """The site that is lost to the crash is found by the other method."""
    site.add("acme-once", ONCE)
    result = damageest.run(small_done, settings=[f"boolean={{use: once, mark: {tmp_path / 'crashed'}}}"], output=True)
    assert (tmp_path / "crashed").exists()
    assert result.status == "ok"
    assert [item.method for item in result.sites] == ["surface"]
    assert result.damage_volume == pytest.approx(damaged_box.TRUE_VOLUME, rel=0.05)


@pytest.mark.slow
def test_the_same_result_as_without_isolation(
    site: Site, small_done: Path, small_result: Result, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """What a worker prints goes to the error stream."""
    site.add("acme-once", ONCE)
    (tmp_path / "crashed").touch()
    isolated = damageest.run(small_done, settings=[f"boolean={{use: once, mark: {tmp_path / 'crashed'}}}"], output=True)
    assert isolated.sites[0].damage.vertices.tobytes() == small_result.sites[0].damage.vertices.tobytes()
    out, err = capfd.readouterr()
    assert "hello" in err
    assert "hello" not in out
