"""Help at hand: what each error and exit status means, the page that an error names, and what is for programs."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from typer.main import get_command
from typer.testing import CliRunner

from damageest.cli import app
from damageest.error_codes import ERROR_CODES, EXIT_STATUSES, STAGE_PAGES, describe_help, find_page, format_errors
from damageest.errors import DamageestError, InputError, StageError
from damageest.registry.contracts import STAGES
from damageest.rules.advice import TOPICS

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "command-line.md").read_text()
WITHOUT_TABLES = {
    "app",
    "init",
    "machine check",
    "machine schema",
    "machine show",
    "nominal",
    "picture",
    "schema",
    "view",
}
"""Commands that write or open files, or print what is for programs already."""


def list_anchors(page: Path) -> set[str]:
    """The anchors of a page's headings, as the site makes them."""
    heads = re.findall(r"^#+ (.*)$", page.read_text(), re.MULTILINE)
    return {re.sub(r"[-\s]+", "-", re.sub(r"[^\w\s-]", "", head.lower()).strip()) for head in heads}


@pytest.mark.parametrize(
    "link", sorted({*(one.page for one in ERROR_CODES.values()), *STAGE_PAGES.values(), *(t.page for t in TOPICS)})
)
def test_a_page_that_errors_name_is_there_with_its_section(link: str) -> None:
    name, _, anchor = link.partition("#")
    assert (ROOT / name).is_file()
    assert not anchor or anchor in list_anchors(ROOT / name)


NAMED = re.compile(r"docs/[\w/-]+\.md(?:#[\w-]+)?")
SOURCES = [*(ROOT / "damageest").rglob("*.py"), *ROOT.glob("plugins/*/damageest_*/**/*.py")]


def test_every_page_that_the_code_names_is_there_with_its_section() -> None:
    named = {link for path in SOURCES for link in NAMED.findall(path.read_text())}
    named |= {find_page(fail_in(stage)) for stage in STAGES}
    assert len(named) > len(STAGES)
    for link in named:
        name, _, anchor = link.partition("#")
        assert (ROOT / name).is_file(), link
        assert not anchor or anchor in list_anchors(ROOT / name), link


@pytest.mark.parametrize("group", [(), ("evaluate",), ("machine",)])
def test_the_lists_of_commands_show_whole_sentences(group: tuple[str, ...]) -> None:
    """In 80 columns: the first sentence of each command is short enough."""
    done = CliRunner().invoke(app, [*group, "--help"], terminal_width=80, env={"COLUMNS": "80"})
    if "No such command" in done.output or "needs the plugin" in done.output:
        pytest.skip("the plugin is not installed")
    listed = done.output.partition("Commands")[2]
    assert len(listed.splitlines()) >= 4
    assert "..." not in listed
    assert "…" not in listed


def fail_in(stage: str) -> StageError:
    error = StageError("no", "yes")
    error.stage = stage
    return error


def test_the_page_has_the_tables_of_errors_and_exit_statuses() -> None:
    between = PAGE.partition("<!-- errors: begin -->\n")[2].partition("<!-- errors: end -->")[0]
    assert between == format_errors(), "write it anew: damageest schema errors"
    assert CliRunner().invoke(app, ["schema", "errors"]).output == format_errors()
    assert set(STAGE_PAGES) <= set(STAGES)


def test_every_error_and_exit_status_is_explained_in_the_words_of_the_page() -> None:
    said = " ".join(CliRunner().invoke(app, ["explain", *ERROR_CODES, "exit"]).output.split())
    for code, one in ERROR_CODES.items():
        assert f"{code} (error, exit status {one.status}): {one.meaning}" in said
        assert one.remedy in said
    for status, meaning in EXIT_STATUSES.items():
        assert f"exit status {status}: {meaning}" in said
    listed = CliRunner().invoke(app, ["explain"]).output
    assert all(f"\n{word:<14}" in f"\n{listed}" for word in (*ERROR_CODES, *(topic.word for topic in TOPICS), "exit"))


@pytest.fixture(scope="module")
def folder(_small_job: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a sound job that has run, and three that cannot."""
    place = tmp_path_factory.mktemp("help")
    shutil.copytree(_small_job, place, dirs_exist_ok=True)
    job = place / "job.yaml"
    text = job.read_text()
    (place / "typo.yaml").write_text(text.replace("align: none", "align: nine"))
    (place / "empty.ply").write_text("ply\n")
    (place / "empty.yaml").write_text(text.replace("scan.ply", "empty.ply"))
    (place / "open.off").write_text("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n")
    (place / "open.yaml").write_text(text.replace("box.stl", "open.off"))
    return place


def call(words: str, folder: Path, monkeypatch: pytest.MonkeyPatch) -> tuple[int, str, str]:
    """Exit status and both outputs of a command; of `run`, which prints its errors itself, in this process."""
    monkeypatch.chdir(folder)
    if " -o " not in words and words.startswith("run"):
        ran = CliRunner().invoke(app, words.split())
        return ran.exit_code, ran.stdout, ran.stderr
    command = [sys.executable, "-c", "from damageest.cli import main; main()", *words.split()]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    return done.returncode, done.stdout, done.stderr


@pytest.mark.parametrize(
    ("words", "code"),
    [
        ("run typo.yaml --json", "job"),
        ("run empty.yaml --json", "scan_file"),
        ("run open.yaml --json", "part_file"),
        ("verify . --json", "result_folder"),
        ("run typo.yaml open.yaml -o out --json", "option"),
    ],
)
def test_an_error_ends_with_the_word_that_explains_it_and_its_page(
    words: str, code: str, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    status, out, err = call(words, folder, monkeypatch)
    one = ERROR_CODES[code]
    assert status == one.status
    assert err.splitlines()[-1] == f"help: damageest explain {code}; see {one.page}"
    (line,) = out.splitlines()
    failed = json.loads(line)
    assert (failed["schema"], failed["status"], failed["code"], failed["exit"]) == (1, "failed", code, one.status)
    assert failed["page"] == one.page


def test_a_stage_a_topic_and_an_unforeseen_error_have_pages_of_their_own() -> None:
    error = StageError("no", "yes")
    error.stage = "path"
    assert describe_help(error) == "help: damageest explain stage; see docs/paths.md"
    topic = InputError("no", topic="unit")
    assert describe_help(topic) == "help: damageest explain unit; see docs/bad-scan.md#the-unit-is-wrong"
    assert describe_help(ZeroDivisionError()) == "help: damageest explain unexpected; see docs/faults.md"


def list_all(command: Any, name: str = "") -> Iterator[tuple[str, Any]]:
    """Every command with its full name."""
    if not hasattr(command, "commands"):
        yield name, command
        return
    for own in command.list_commands(None):
        yield from list_all(command.get_command(None, own), f"{name} {own}".strip())


def test_every_command_that_prints_a_table_has_json_and_is_on_the_page() -> None:
    found = dict(list_all(get_command(app)))
    having = {name for name, command in found.items() if any("--json" in one.opts for one in command.params)}
    assert set(found) - having <= WITHOUT_TABLES
    listed = {row[0] for row in read_rows()}
    assert {name if not name.startswith("evaluate ") else "evaluate …" for name in having} <= listed


def read_rows() -> list[tuple[str, list[str], list[str]]]:
    """The page's table: command, its fields, those of each entry of the first list."""
    rows = re.findall(r"^\| `([^`]+)` \| (.*) \| (.*)\|$", PAGE.partition("## For programs")[2], re.MULTILINE)
    return [(name, re.findall(r"`([a-z_]+)`", own), re.findall(r"`([a-z_]+)`", each)) for name, own, each in rows]


@pytest.mark.parametrize(
    "words",
    [
        "validate {0}/job.yaml",
        "verify {0}/out/job",
        "explain noise",
        pytest.param("doctor --quick", marks=pytest.mark.slow),
        "stages",
        "plugins",
        "machine list",
    ],
)
def test_the_fields_of_a_command_are_those_of_the_page(words: str, folder: Path) -> None:
    done = CliRunner().invoke(app, [*words.format(folder).split(), "--json"])
    told = json.loads(done.stdout)
    own, each = next((own, each) for name, own, each in read_rows() if words.startswith(name))
    own = [name for name in own if name != "null"]
    assert next(iter(told)) == "schema"
    assert told.pop("schema") == 1
    assert set(told) == set(own)
    if each:
        assert set(told[own[0]][0]) == set(each)


def test_a_failure_in_this_process_has_a_code_too(folder: Path) -> None:
    done = CliRunner().invoke(app, ["verify", str(folder)])
    assert isinstance(done.exception, DamageestError)
    assert done.exception.code == "result_folder"


def test_the_help_line_needs_no_libraries() -> None:
    """Where a run ended for want of memory, to load numpy as well may never end."""
    code = (
        "import sys; from damageest.cli._errors import say_help; from damageest.errors import StageError; "
        "say_help(StageError('ended', 'try', code='crash')); sys.exit('numpy' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert (done.returncode, done.stderr[:29]) == (0, "help: damageest explain crash")
