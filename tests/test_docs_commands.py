"""The documentation shows commands that can be called, jobs that are valid, and links to files that are there."""

from __future__ import annotations

import importlib.util
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import typer
from damageest_benchmarks.readme import MATRIX
from damageest_evaluate.report import make_legend
from typer.main import get_command

from damageest.cli import app
from damageest.job import load
from damageest.job.yamlfile import parse
from damageest.registry import Registry
from tests.needs import PLUGINS, needs_plugin

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted(DOCS.glob("*.md")), *sorted(DOCS.glob("stages/*.md"))]


def blocks(page: Path, language: str) -> list[str]:
    found = re.findall(r"^```(\w*)\n(.*?)^```$", page.read_text(), re.DOTALL | re.MULTILINE)
    return [block for kind, block in found if kind == language]


def commands(page: Path) -> list[list[str]]:
    """The words of each `damageest` command in the page's blocks, without `damageest` itself."""
    lines = [line for block in (*blocks(page, "sh"), *blocks(page, "")) for line in block.splitlines()]
    parts = [part.strip() for line in lines for part in line.split("&&")]
    calls = [re.match(r"(?:uv run )?damageest (.*)", part) for part in parts]
    return [shlex.split(call[1], comments=True) for call in calls if call]


SHOWN = [(page, words) for page in PAGES for words in commands(page)]


@pytest.mark.parametrize(("page", "words"), SHOWN, ids=[f"{p.name}: {' '.join(w)[:60]}" for p, w in SHOWN])
def test_a_command_is_one(page: Path, words: list[str]) -> None:
    command: Any = get_command(app)
    context = typer.Context(command, info_name="damageest")
    while words and hasattr(command, "get_command") and not words[0].startswith("-"):
        found = command.get_command(context, words[0])
        assert found is not None, f"there is no command {words[0]}"
        command, words = found, words[1:]
    if words != ["--version"]:
        command.make_context(command.name, list(words), parent=context)
    named = [word for word in words if word.startswith("jobs/") and not word.startswith("jobs/out/")]
    written_there = {"jobs/my_block.yaml"}
    assert all((ROOT / name).is_file() or name in written_there for name in named), "the file is there"


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("nonsense", "there is no command nonsense"),
        ("run job.yaml --nonsense", "No such option: --nonsense"),
        ("evaluate suite --cases many", "valid int"),
    ],
)
def test_a_command_that_is_none_is_seen(line: str, said: str) -> None:
    with pytest.raises(Exception, match=said):
        test_a_command_is_one(PAGES[0], line.split())


def load_runner() -> Any:
    """`.ci/pages.py`, which runs all that the pages show."""
    spec = importlib.util.spec_from_file_location("pages", ROOT / ".ci/pages.py")
    assert spec
    assert spec.loader
    sys.modules["pages"] = module = importlib.util.module_from_spec(spec)  # dataclasses look there
    spec.loader.exec_module(module)
    return module


RUNNER = load_runner()
READ = [(page.name, block) for page in RUNNER.list_pages(ROOT) for block in RUNNER.read_blocks(page)]
REASONS = {
    "starts a server": ["app.md: damageest app jobs", "batch.md: dask scheduler --port 8786"],
    "needs a container engine": ["install.md: docker build --target core -t damageest ."],
    "needs a file of the reader": ["inspect.md: damageest inspect out/blade after.ply --step deposited"],
    "takes hours": [
        "accuracy.md: damageest evaluate",
        "adaptive.md: damageest evaluate",
        "exact-step.md: python -m damageest_benchmarks.exact",
        "your-own-scan.md: damageest evaluate",
    ],
}
"""Why a command of a page is not run in a bare Debian, and where each reason stands."""


def test_what_is_not_run_is_listed_here() -> None:
    """Nobody can mark a command silently, and no mark stays that marks nothing."""
    skipped = [(block.skipped, f"{name}: {block.commands()[0]}") for name, block in READ if block.skipped]
    for reason, line in skipped:
        assert any(line.startswith(start) for start in REASONS.get(reason, ())), f"{line}: not run: {reason}"
    for reason, starts in REASONS.items():
        for start in starts:
            assert any(line.startswith(start) for why, line in skipped if why == reason), f"no mark for {start}"


def test_each_mark_stands_above_a_block() -> None:
    marks = sum(len(re.findall(r"^<!-- (?:not run|file): ", p.read_text(), re.MULTILINE)) for p in PAGES)
    assert marks == sum(bool(block.skipped or block.file) for _, block in READ)


def test_pages_for_users_take_what_the_readme_set_up() -> None:
    """Neither uv nor pip is on the path there; `.uv/bin/uv` adds to what is there, and takes nothing away."""
    for name, block in READ:
        for command in [] if block.file or block.skipped else block.commands():
            words = command.split()
            assert words[0] not in ("uv", "pip", "pip3"), f"{name}: {command}"
            if ".uv/bin/uv sync" in command and "--all-packages" not in words and "report" not in words:
                assert "--inexact" in words, f"{name}: {command}"


def test_the_runner_keeps_place_and_environment_and_counts_failures(tmp_path: Path) -> None:
    reader = RUNNER.Reader(tmp_path, 0)
    reader.begin(tmp_path)
    for command in (
        "mkdir here && cd here",
        "export WORD='two words'",
        'test "$WORD" = "two words"',
        "test $(pwd) = $PWD",
    ):
        reader.run(command)
    reader.run("exit 1  # exit status 1")
    assert (reader.failed, reader.type_in("pwd").stdout) == (0, f"{tmp_path / 'here'}\n")
    reader.run("nonsense")
    assert reader.failed == 1


def test_pages_show_commands() -> None:
    assert {page.name for page, _ in SHOWN} >= {"README.md", "first-repair.md", "your-own-scan.md", "accuracy.md"}


MONTHS = ("scans/block_may.ply", "scans/block_june.ply")


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the files that the jobs in the documentation name."""
    folder = tmp_path_factory.mktemp("docs")
    (folder / "parts").mkdir()
    (folder / "scans").mkdir()
    shutil.copy(ROOT / "jobs" / "parts" / "block.stl", folder / "parts")
    for name in ("part.step", "parts/gear.step"):
        shutil.copy(ROOT / "jobs" / "parts" / "gear.step", folder / name)
    for name in (
        "scan.ply",
        "view-1.ply",
        "view-2.ply",
        "scans/block_wedge.ply",
        "scans/gear.ply",
        "patches/1.ply",
        *MONTHS,
    ):
        (folder / name).parent.mkdir(exist_ok=True)
        shutil.copy(ROOT / "jobs" / "scans" / "block_wedge.ply", folder / name)
    return folder


JOBS = [(page, block) for page in PAGES if page.name != "plugin-guide.md" for block in blocks(page, "yaml")]


@needs_plugin(*PLUGINS)
@pytest.mark.parametrize(("page", "block"), JOBS, ids=[f"{p.name}: {b.splitlines()[0][:40]}" for p, b in JOBS])
def test_a_job_is_valid(page: Path, block: str, files: Path, registry: Registry) -> None:
    tree, _ = parse(block, page.name)
    if "version" not in tree:  # some lines of one
        block = "version: 1\npart: part.step\nscan: scan.ply\n" + block
    (files / "job.yaml").write_text(block)
    load(files / "job.yaml", registry)


@pytest.mark.slow
def test_the_first_repair_goes_as_its_page_says(tmp_path: Path) -> None:
    """Its commands one after the other, and the table that it shows."""
    page = ROOT / "docs" / "first-repair.md"
    for folder in ("parts", "scans"):
        shutil.copytree(ROOT / "jobs" / folder, tmp_path / "jobs" / folder)
    shutil.copy(ROOT / "jobs" / "block_wedge.yaml", tmp_path / "jobs")
    own = next(block for block in blocks(page, "yaml") if "simulate" in block)
    (tmp_path / "jobs" / "my_block.yaml").write_text(own)
    said = ""
    for words in commands(page):
        command = [sys.executable, "-c", "from damageest.cli import main; main()", *words]
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        said += done.stdout
    (shown,) = blocks(page, "text")
    for line in shown.splitlines():
        pattern = re.sub(r"\\\.\d+", r"\\.\\d+", re.escape(" ".join(line.split())))  # decimals may differ
        assert re.search(pattern, " ".join(said.split())), f"the run does not say: {line}"
    assert (tmp_path / "jobs" / "out" / "block_wedge" / "deposit" / "site-1.stl").is_file()


def test_pages_show_the_same_table_of_the_same_run() -> None:
    """README and Uncertainty show the first lines of what First repair shows; a slow test compares that with a run."""
    (shown,) = blocks(ROOT / "docs" / "first-repair.md", "text")
    (first,) = blocks(ROOT / "README.md", "text")
    top = "".join(shown.splitlines(keepends=True)[:3])
    assert first == top
    assert blocks(ROOT / "docs" / "uncertainty.md", "text")[0] == top


def test_links_lead_to_files() -> None:
    targets = [(page, at) for page in PAGES for at in re.findall(r"\]\(([^)#:]+)(?:#[^)]*)?\)", page.read_text())]
    missing = [f"{page.name}: {at}" for page, at in targets if not (page.parent / at).is_file()]
    assert not [one for one in missing if not one.endswith(": ARCHITECTURE.md")], "links to files that are not there"


def test_the_legend_of_the_measurements_is_that_of_the_tables() -> None:
    page = ROOT / "benchmarks" / "results" / "damages.md"
    text = " ".join(page.read_text().replace("\n- ", "\n").split())
    for sentence in (*make_legend("mm").split(". "), MATRIX):
        assert sentence.rstrip(".") in text, "damages.md explains the columns once: bring it up to date"
        assert text.count(sentence.rstrip(".")) == 1
