"""A plugin's stage that crashes, exits, hangs or takes all memory: named, exit status 1, the earlier output intact."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

import damageest
from damageest.errors import StageError
from damageest.isolation import Limits, end_workers
from tests import damaged_box
from tests.registry.test_registry import GROWN, Site, site

__all__ = ["site"]
CLUSTER = '''
from damageest.artefacts import Deviation, Sites
from damageest.stages.cluster import Cluster

class Faulty(Cluster):
    """As native libraries are at times."""
    isolated = True
    use: Literal["faulty"] = "faulty"
    def run(self, deviation: Deviation) -> Sites:
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
    "hang": ("while True: pass", "not finished after 1 s, the time limit of a stage"),
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


def run(job: Path, site: Site, *words: str) -> subprocess.CompletedProcess[str]:
    code = "from damageest.cli import main; main()"
    paths = os.pathsep.join([str(site.folder), os.environ.get("PYTHONPATH", "")])
    return subprocess.run(
        [sys.executable, "-c", code, "run", str(job), *words],
        capture_output=True,
        text=True,
        env={**os.environ, "PYTHONPATH": paths},
        check=False,
    )


def test_each_fault_is_the_stages_own(site: Site, tmp_path: Path) -> None:
    """From Python: a worker process for each source of the plugin, so each fault has its own."""
    path = damaged_box.write_small(tmp_path)
    damageest.run(path, output=True)
    before = damaged_box.content(tmp_path / "out/job")
    for name, (body, text) in FAULTS.items():
        module = f"acme-{name.replace(' ', '-')}"
        site.add(module, CLUSTER.replace("BODY", body).replace("faulty", module))
        limits = Limits(4 * 10**9, 1 if name == "hang" else 60)
        with pytest.raises(StageError) as caught:
            damageest.run(path, output=True, settings=[f"cluster={module}"], limits=limits)
        assert text in caught.value.message
        assert str(caught.value).startswith(f"cluster: {module}: ")
        assert f"{module} 1.2" in caught.value.remedy or name == "memory"
        after = damaged_box.content(tmp_path / "out/job")
        assert {file: after[file] for file in before} == before


def test_a_hang_on_the_command_line(site: Site, tmp_path: Path) -> None:
    site.add("acme-bad", CLUSTER.replace("BODY", FAULTS["hang"][0]))
    job = damaged_box.write_small(tmp_path, "cluster: faulty\n")
    done = run(job, site, "--stage-timeout", "1", "--memory", "4GB")
    assert done.returncode == 1
    assert "cluster: faulty: was ended: not finished after 1 s" in " ".join(done.stderr.split())
    assert "  cluster: faulty  " in done.stderr, "the stage is named when it begins"
    assert "acme-bad 1.2" in done.stderr


def test_sys_exit_in_a_stage_without_a_process_of_its_own(site: Site, tmp_path: Path) -> None:
    body = "return Solid(damage.vertices * self.factor, damage.faces)"
    site.add("acme-bad", GROWN.replace(body, "import sys; sys.exit(0)"))
    result = damageest.run(damaged_box.write_small(tmp_path, "allowance: doubled\n"))
    assert any("allowance: doubled (site 1): called sys.exit(0)" in text for text in result.failures)
    assert "acme-bad 1.2" in " ".join(result.failures)


def test_method_auto_goes_on_after_a_crash(site: Site, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """The site that is lost to the crash is found by the other method. What a worker prints goes to the error
    stream."""
    site.add("acme-once", ONCE)
    path = damaged_box.write_small(tmp_path)
    result = damageest.run(path, settings=[f"boolean={{use: once, mark: {tmp_path / 'crashed'}}}"])
    assert (tmp_path / "crashed").exists()
    assert result.status == "ok"
    assert [item.method for item in result.sites] == ["surface"]
    assert result.damage_volume == pytest.approx(damaged_box.TRUE_VOLUME, rel=0.05)
    out, err = capfd.readouterr()
    assert "hello" in err
    assert "hello" not in out


def test_the_same_result_as_without_isolation(site: Site, tmp_path: Path) -> None:
    site.add("acme-once", ONCE)
    (tmp_path / "crashed").touch()
    path = damaged_box.write_small(tmp_path)
    isolated = damageest.run(path, settings=[f"boolean={{use: once, mark: {tmp_path / 'crashed'}}}"])
    own = damageest.run(path)
    assert isolated.sites[0].damage.vertices.tobytes() == own.sites[0].damage.vertices.tobytes()
