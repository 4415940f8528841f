"""What the command line prints: results for programs stay clean, and a stream that is closed, full or of another
encoding ends no run."""

from __future__ import annotations

import codecs
import contextlib
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

import damageest
from damageest.cli import _streams
from damageest.errors import InputError
from tests.cli.calls import call
from tests.cli.test_watched_stages import FAULTY, environment, write_job
from tests.needs import needs_plugin
from tests.registry.test_registry import Site, site

__all__ = ["site"]
STEP = Path(__file__).parents[2] / "jobs/parts/half_torus.step"
MAIN = f"{sys.executable} -c 'from damageest.cli import main; main()'"
PRINTING = """
import ctypes, os, sys
print("from Python")
ctypes.CDLL(None).puts(b"from C, held back")
os.write(1, b"to the file number\\n")
os.system("echo from a child")
import atexit
atexit.register(os.write, 1, b"at the end\\n")
"""


def shell(command: str, cwd: Path, env: dict[str, str] | None = None) -> subprocess.CompletedProcess[bytes]:
    return subprocess.run(["sh", "-c", f"{MAIN} {command}"], cwd=cwd, capture_output=True, env=env, timeout=120)


@pytest.fixture
def ready(small_done: Path) -> Path:
    """A folder with a job that has run, so that to run it again takes little."""
    return small_done.parent


COMMANDS = {
    "run": "run job.yaml",
    "run --json": "run job.yaml --json",
    "validate": "validate job.yaml",
    "verify": "verify out/job",
    "init": "init box.stl scan.ply -o new.yaml",
    "stages": "stages",
    "stages of one": "stages cluster dbscan",
    "plugins": "plugins",
    "schema": "schema result",
    "help": "--help",
    "help of run": "run --help",
    "evaluate": "evaluate honesty --list",
    "batch": "batch job.yaml --workers 1 --out many",
}
OFTEN = ("run", "run --json", "validate", "schema", "help")  # the others behave as one of them
WORDS = {">/dev/full": b"No space left on device", ">&-": b"Bad file descriptor"}


def mark_slow(second: str, *ways: str) -> list[Any]:
    """Each of `OFTEN` with each of the ways: by default `validate` with the first, and the command ``second`` with the
    other one."""
    quick = {("validate", ways[0]), (second, ways[1])}
    pairs = [(name, way) for name in OFTEN for way in ways]
    return [pair if pair in quick else pytest.param(*pair, marks=pytest.mark.slow) for pair in pairs]


@pytest.mark.variants(1, slow=4)
@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no /dev/full here")
@pytest.mark.parametrize(("name", "stream"), mark_slow("schema", *WORDS))
def test_standard_output_that_takes_nothing_is_named(name: str, stream: str, ready: Path) -> None:
    ran = shell(f"{COMMANDS[name]} {stream}", ready)
    assert ran.returncode == 1
    assert b"error: standard output cannot be written: " + WORDS[stream] in ran.stderr
    assert b"unexpected" not in ran.stderr
    assert b"Traceback" not in ran.stderr
    if name.startswith("run"):
        assert json.loads((ready / "out/job/result.json").read_text())["status"] == "ok"


@pytest.mark.variants(1, slow=4)
@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no /dev/full here")
@pytest.mark.parametrize(("name", "stream"), mark_slow("help", "2>/dev/full", "2>&-"))
def test_standard_error_that_takes_nothing_changes_nothing(name: str, stream: str, ready: Path) -> None:
    ran = shell(f"{COMMANDS[name]} {stream}", ready)
    assert ran.returncode == 0
    assert ran.stdout


@pytest.fixture(scope="module")
def without_streams(least_job: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[int, Path]:
    """The exit status of a run without any stream, and its output folder."""
    folder = tmp_path_factory.mktemp("streams")
    shutil.copytree(least_job, folder, dirs_exist_ok=True)
    (folder / "out/job/result.json").write_text('{"earlier": true}')
    return shell("run job.yaml <&- >&- 2>&-", folder).returncode, folder / "out/job"


def test_a_run_without_any_stream_writes_its_result(without_streams: tuple[int, Path]) -> None:
    assert json.loads((without_streams[1] / "result.json").read_text())["status"] == "ok"


def test_a_run_without_any_stream_says_so_by_its_exit_status(without_streams: tuple[int, Path]) -> None:
    assert without_streams[0] == 1


@pytest.mark.slow
@pytest.mark.parametrize("stream", ["<&- >&- 2>&-", ">&- 2>&-", ">/dev/full 2>/dev/full"])
def test_a_run_that_computes_without_any_stream_writes_its_result(stream: str, ready: Path) -> None:
    shutil.rmtree(ready / "out/job")
    assert shell(f"run job.yaml {stream}", ready).returncode == 1
    assert json.loads((ready / "out/job/result.json").read_text())["status"] == "ok"
    assert shell(f"run job.yaml -q {stream}", ready).returncode == 0, "it prints nothing, so nothing is missing"


@pytest.mark.variants(1, slow=4)
@pytest.mark.parametrize(("name", "encoding"), mark_slow("help", "ascii", "latin-1"))
def test_another_encoding_shows_what_it_can(name: str, encoding: str, ready: Path) -> None:
    env = {**os.environ, "PYTHONIOENCODING": encoding, "PYTHONUTF8": "0"}
    ran = shell(COMMANDS[name], ready, env)
    assert ran.returncode == 0, ran.stderr
    text = ran.stdout.decode(encoding)
    if name == "run":
        assert "damage volume: " in text
        assert ("mm3" if encoding == "ascii" else "mm³") in text


def test_characters_that_an_encoding_has_not_are_written_in_others() -> None:
    codecs.register_error("tests", _streams._replace)
    assert "4 mm³, ±1 µm → λ ü".encode("ascii", "tests") == b"4 mm3, +-1 um -> lambda \\xfc"
    assert "4 mm³, ±1 µm → ü".encode("latin-1", "tests") == "4 mm³, ±1 µm -> ü".encode("latin-1")


ASCII = {"PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0", "LC_ALL": "POSIX"}


@pytest.mark.slow
def test_an_ascii_locale_reads_a_job(ready: Path) -> None:
    (ready / "schräg").mkdir()
    shutil.copy(ready / "scan.ply", ready / "schräg/scan.ply")
    text = (ready / "job.yaml").read_text(encoding="utf-8").replace("scan.ply", "schräg/scan.ply")
    (ready / "job.yaml").write_text(text, encoding="utf-8")
    ran = shell("validate job.yaml", ready, {**os.environ, **ASCII})
    # where file names are ASCII, no such file can be named; what counts is that it is said
    assert ran.returncode in (0, 2), ran.stderr
    assert b"unexpected" not in ran.stderr


@pytest.mark.slow
def test_an_ascii_locale_writes_the_same_files(ready: Path) -> None:
    (ready / "schräg").mkdir()
    shutil.copy(ready / "scan.ply", ready / "schräg/scan.ply")
    usual = (ready / "job.yaml").read_text(encoding="utf-8")
    (ready / "job.yaml").write_text(usual.replace("scan.ply", "schräg/scan.ply"), encoding="utf-8")
    env = {**os.environ, **ASCII}
    ran = shell("run job.yaml -o ascii", ready, env)
    # where file names are ASCII, no such file can be named; what counts is that it is said
    assert ran.returncode in (0, 2), ran.stderr
    assert b"unexpected" not in ran.stderr
    (ready / "job.yaml").write_text(usual, encoding="utf-8")
    assert shell("run job.yaml -o out/ascii", ready, env).returncode == 0
    assert (ready / "out/ascii/job.yaml").read_bytes() == (ready / "out/job/job.yaml").read_bytes()


@pytest.mark.parametrize("name", ["run", "verify", "init", "batch", "help"])
def test_a_working_directory_that_was_deleted_is_named(name: str, tmp_path: Path) -> None:
    (tmp_path / "gone").mkdir()
    ran = subprocess.run(
        ["sh", "-c", f"cd gone; rmdir ../gone; {MAIN} {COMMANDS[name]}"], cwd=tmp_path, capture_output=True, timeout=60
    )
    assert ran.returncode == 2
    assert ran.stderr.startswith(b"error: the working directory cannot be used: ")
    assert [line[:6] for line in ran.stderr.splitlines()[1:]] == [b"help: "]


def test_a_deleted_working_directory_in_python(tmp_path: Path, ready: Path) -> None:
    (tmp_path / "gone").mkdir()
    for job, more in ((ready / "job.yaml", {"output": "x"}), ({"version": 1}, {})):
        with contextlib.chdir(tmp_path / "gone"):
            (tmp_path / "gone").rmdir()
            with pytest.raises(InputError, match="the working directory cannot be used"):
                damageest.run(job, **more)  # type: ignore[arg-type]
            (tmp_path / "gone").mkdir()


def find_printed(said: bytes) -> list[str]:
    return [
        text
        for text in ("from Python", "from C, held back", "to the file number", "from a child")
        if text in said.decode()
    ]


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["run", "failed"])
def test_json_is_alone_on_standard_output(kind: str, site: Site, ready: Path) -> None:
    site.add("acme-bad", FAULTY + PRINTING)
    fault = PRINTING + ("raise ValueError('no')" if kind == "failed" else "")
    job = write_job(ready, "printing", fault)
    ran = shell(f"run {job} {job} --json", ready, environment(site))
    lines = ran.stdout.decode().splitlines()
    assert [json.loads(line)["status"] for line in lines] == ["failed" if kind == "failed" else "ok"] * 2
    assert len(find_printed(ran.stderr)) == 4


@pytest.mark.slow
@needs_plugin("cadquery")
@pytest.mark.parametrize(
    "command",
    [
        "validate job.yaml --json",
        "faces part.step --json",
        *(pytest.param(one, marks=pytest.mark.slow) for one in ("schema", "schema result")),
    ],
)
def test_json_of_other_commands_is_alone_too(command: str, site: Site, ready: Path) -> None:
    site.add("acme-bad", FAULTY + PRINTING)
    shutil.copy(STEP, ready / "part.step")
    ran = shell(command, ready, environment(site))
    assert json.loads(ran.stdout), ran.stderr
    if "--json" in command:
        assert len(find_printed(ran.stderr)) == 4


@pytest.mark.slow
def test_a_file_name_that_is_no_text_is_shown(ready: Path) -> None:
    name = os.fsdecode(b"sc\xffn.yaml")
    os.rename(ready / "job.yaml", ready / name)
    ran = subprocess.run(
        [sys.executable, "-c", "from damageest.cli import main; main()", "validate", name, name + "x"],
        cwd=ready, capture_output=True, text=True, timeout=100,
    )  # fmt: skip
    assert ran.returncode == 2
    assert r"sc\udcffn.yaml" in ran.stderr
    assert "unexpected" not in ran.stderr


DEEP = "[" * 200_000


@pytest.mark.parametrize("command", ["verify", "view"])
def test_an_old_result_of_any_depth_is_named(command: str, ready: Path) -> None:
    (ready / "out/job/result.json").write_text(DEEP)
    status, said = call(command, ready / "out/job")
    assert status == 2
    assert "cannot be read as a result" in said


@pytest.mark.slow
def test_a_run_replaces_an_old_result_of_any_depth(ready: Path) -> None:
    (ready / "out/job/result.json").write_text(DEEP)
    assert call("run", ready / "job.yaml", "-q") == (0, "")
    assert json.loads((ready / "out/job/result.json").read_text())["status"] == "ok"


@pytest.mark.slow
def test_a_batch_replaces_an_old_table_of_any_depth(ready: Path) -> None:
    (ready / "many").mkdir()
    (ready / "many/batch.json").write_text(DEEP)
    assert shell("batch job.yaml --workers 1 --out many -q", ready).returncode == 0
