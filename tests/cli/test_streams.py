"""What the command line prints: texts of others are shown as they are, results for programs stay clean, and a stream
that is closed, full or of another encoding ends no run."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

import damageest
from damageest.artefacts import Reason
from damageest.cli._run_table import print_table
from tests import damaged_box
from tests.cli.test_watched_stages import FAULTY, environment, write_job
from tests.needs import needs_plugin
from tests.registry.test_registry import Site, site

__all__ = ["site"]
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


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a job that has run, so that to run it again takes little."""
    folder = tmp_path_factory.mktemp("streams")
    ran = shell(f"run {damaged_box.write(folder)}", folder)
    assert ran.returncode == 0, ran.stderr
    return folder


@pytest.fixture
def ready(done: Path, tmp_path: Path) -> Path:
    shutil.copytree(done, tmp_path / "work")
    return tmp_path / "work"


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
OFTEN = ("run", "run --json", "validate", "schema", "help")
"""Commands that are tried with each stream; the others behave as one of them."""
WORDS = {">/dev/full": b"No space left on device", ">&-": b"Bad file descriptor"}


def mark_slow(ways: Iterable[str]) -> list[Any]:
    """Each of `OFTEN` with each of the ways: runs with the first, and with the others in the slow tests."""
    first, *others = ways
    rest = [(name, way) for name in OFTEN for way in others]
    slow = [pytest.param(*pair, marks=pytest.mark.slow) if pair[0].startswith("run") else pair for pair in rest]
    return [(name, first) for name in OFTEN] + slow


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no /dev/full here")
@pytest.mark.parametrize(("name", "stream"), mark_slow(WORDS))
def test_standard_output_that_takes_nothing_is_named(name: str, stream: str, ready: Path) -> None:
    ran = shell(f"{COMMANDS[name]} {stream}", ready)
    assert ran.returncode == 1
    assert b"error: standard output cannot be written: " + WORDS[stream] in ran.stderr
    assert b"unexpected" not in ran.stderr
    assert b"Traceback" not in ran.stderr
    if name.startswith("run"):
        assert json.loads((ready / "out/job/result.json").read_text())["status"] == "ok"


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no /dev/full here")
@pytest.mark.parametrize(("name", "stream"), mark_slow(["2>/dev/full", "2>&-"]))
def test_standard_error_that_takes_nothing_changes_nothing(name: str, stream: str, ready: Path) -> None:
    ran = shell(f"{COMMANDS[name]} {stream}", ready)
    assert ran.returncode == 0
    assert ran.stdout


@pytest.mark.parametrize(
    "stream",
    [
        "<&- >&- 2>&-",
        *(pytest.param(one, marks=pytest.mark.slow) for one in (">&- 2>&-", ">/dev/full 2>/dev/full")),
    ],
)
def test_a_run_without_any_stream_writes_its_result(stream: str, ready: Path) -> None:
    shutil.rmtree(ready / "out/job")
    assert shell(f"run job.yaml {stream}", ready).returncode == 1
    assert json.loads((ready / "out/job/result.json").read_text())["status"] == "ok"
    assert shell(f"run job.yaml -q {stream}", ready).returncode == 0, "it prints nothing, so nothing is missing"


@pytest.mark.parametrize(("name", "encoding"), mark_slow(["ascii", "latin-1"]))
def test_another_encoding_shows_what_it_can(name: str, encoding: str, ready: Path) -> None:
    env = {**os.environ, "PYTHONIOENCODING": encoding, "PYTHONUTF8": "0"}
    ran = shell(COMMANDS[name], ready, env)
    assert ran.returncode == 0, ran.stderr
    text = ran.stdout.decode(encoding)
    if name == "run":
        assert "damage volume: " in text
        assert ("mm3" if encoding == "ascii" else "mm³") in text


def test_an_ascii_locale_writes_the_same_files(ready: Path) -> None:
    (ready / "schräg").mkdir()
    shutil.copy(ready / "scan.ply", ready / "schräg/scan.ply")
    (ready / "job.yaml").write_text(damaged_box.JOB.replace("scan.ply", "schräg/scan.ply"), encoding="utf-8")
    env = {**os.environ, "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0", "LC_ALL": "POSIX"}
    ran = shell("run job.yaml -o ascii", ready, env)
    # where file names are ASCII, no such file can be named; what counts is that it is said
    assert ran.returncode in (0, 2), ran.stderr
    assert b"unexpected" not in ran.stderr
    (ready / "job.yaml").write_text(damaged_box.JOB, encoding="utf-8")
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


def test_a_deleted_working_directory_in_python(tmp_path: Path) -> None:
    job = damaged_box.write(tmp_path)
    (tmp_path / "gone").mkdir()
    code = (
        "import os, damageest; from damageest.errors import InputError; os.rmdir(os.getcwd())\n"
        f"for more in ({{'output': 'x'}}, {{}}):\n"
        f"    try: damageest.run({str(job)!r} if more else {{'version': 1}}, **more)\n"
        "    except InputError as error: print(error)\n"
    )
    ran = subprocess.run([sys.executable, "-c", code], cwd=tmp_path / "gone", capture_output=True, text=True)
    assert ran.stdout.count("the working directory cannot be used") == 2, ran.stderr


@pytest.mark.parametrize("kind", ["run", "failed"])
def test_json_is_alone_on_standard_output(kind: str, site: Site, ready: Path) -> None:
    site.add("acme-bad", FAULTY + PRINTING)
    fault = PRINTING + ("raise ValueError('no')" if kind == "failed" else "")
    job = write_job(ready, "printing", fault)
    ran = shell(f"run {job} {job} --json", ready, environment(site))
    lines = ran.stdout.decode().splitlines()
    assert [json.loads(line)["status"] for line in lines] == ["failed" if kind == "failed" else "ok"] * 2
    for text in ("from Python", "from C, held back", "to the file number", "from a child"):
        assert text in ran.stderr.decode()


@needs_plugin("cadquery")
@pytest.mark.parametrize("command", ["schema", "schema result", "faces part.step --json"])
def test_json_of_other_commands_is_alone_too(command: str, site: Site, tmp_path: Path) -> None:
    from tests.faults import seeds

    site.add("acme-bad", FAULTY + PRINTING)
    (tmp_path / "part.step").write_bytes(seeds.seed("part.step"))
    ran = shell(command, tmp_path, environment(site))
    assert ran.returncode == 0, ran.stderr
    assert json.loads(ran.stdout)


HARMFUL = "[/red] [bold]x :bomb: \x1b[31mred\x1b]0;title\x07 \x9b2J ‮back"
SHOWN = r"[/red] [bold]x :bomb: \x1b[31mred\x1b]0;title\x07 \x9b2J \u202eback"


@pytest.mark.parametrize("way", ["error", "library"])
def test_texts_of_plugins_are_shown_as_they_are(way: str, site: Site, ready: Path) -> None:
    site.add("acme-bad", FAULTY)
    raised = {
        "error": f"from damageest.errors import StageError; raise StageError({HARMFUL!r} + 'x' * 50_000_000)",
        "library": f"raise ValueError({HARMFUL!r} + 'x' * 50_000_000)",
    }
    ran = shell(f"run {write_job(ready, 'harmful', raised[way])}", ready, environment(site))
    said = ran.stderr.decode()
    assert SHOWN in said, said[:2000]
    assert not [one for one in said if one in "\x1b\x07\x9b\u202e"]
    assert len(said) < 100_000
    assert ran.returncode == 1


def test_notes_and_failures_are_shown_as_they_are(ready: Path, capsys: pytest.CaptureFixture[str]) -> None:
    result = damageest.run(ready / "job.yaml", output=True)
    notes = (Reason("x", HARMFUL), Reason("y", "x" * 50_000_000))
    told = replace(result, warnings=notes, failures=(HARMFUL,))
    print_table(told, ready / "final [v2]")
    said = capsys.readouterr().out
    assert f"note: {SHOWN}" in said
    assert f"failed: {SHOWN}" in said
    assert len(said) < 20_000
    assert said.splitlines()[-1] == f"written to {ready / 'final [v2]'}"


@pytest.mark.parametrize(
    "output", ["[red]a\tb\x1b[1m", *(pytest.param(one, marks=pytest.mark.slow) for one in ("final [v2]", ":bomb:"))]
)
def test_the_printed_path_is_that_of_the_folder(output: str, ready: Path) -> None:
    ran = subprocess.run(
        [sys.executable, "-c", "from damageest.cli import main; main()", "run", "job.yaml", "-o", output],
        cwd=ready, capture_output=True, text=True, timeout=100,
    )  # fmt: skip
    assert ran.returncode == 0, ran.stderr
    assert (ready / output / "result.json").is_file()
    shown = output.replace("\t", " ").replace("\x1b", r"\x1b")
    assert ran.stdout.splitlines()[-1] == f"written to {(ready / shown).resolve()}"


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


def test_an_old_result_of_any_depth_is_no_fault_of_the_program(ready: Path) -> None:
    (ready / "out/job/result.json").write_text("[" * 200_000)
    for command in ("verify out/job", "view out/job"):
        ran = shell(command, ready)
        assert ran.returncode == 2
        assert b"cannot be read as a result" in ran.stderr
    assert shell("run job.yaml -q", ready).returncode == 0
    assert json.loads((ready / "out/job/result.json").read_text())["status"] == "ok"
    (ready / "many").mkdir()
    (ready / "many/batch.json").write_text("[" * 200_000)
    assert shell("batch job.yaml --workers 1 --out many -q", ready).returncode == 0
