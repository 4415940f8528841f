"""The page on bad scans shows what the program says: lines of its jobs, the words of `damageest explain`."""

from __future__ import annotations

import io
import re
from collections.abc import Callable
from contextlib import redirect_stderr
from functools import cache
from pathlib import Path

import pytest
from typer.testing import CliRunner

from damageest.cli import app
from damageest.cli._errors import say_error
from damageest.errors import DamageestError
from damageest.registry import builtins
from damageest.registry.contracts import STAGES
from damageest.rules.advice import TOPICS, Topic
from damageest.rules.notes import RUN_CODES
from damageest.trust.doubts.pose import POSE_CODES
from tests import damaged_box
from tests.needs import import_or_skip

ROOT = Path(__file__).parents[1]
PAGE = (ROOT / "docs" / "bad-scan.md").read_text()
JOBS = ROOT / "jobs" / "bad_scans"
FAST = {"unit", "confidence"}
"""Jobs that take a second or two; the others are run by -m slow only."""
QUOTED = re.findall(r"^`jobs/bad_scans/(\w+)\.yaml` says:\n\n```text\n(.*?)^```$", PAGE, re.DOTALL | re.MULTILINE)
STARTS = re.compile(r"\n(?=error: |note: |surplus |unseen: |tolerance: |fit: |smallest |no damage )")
"""Where a line of the program begins, in a block whose long lines are broken."""


def mask(text: str) -> str:
    """A text with one space between words and without figures; a list of several is as one."""
    masked = re.sub(r"(?<![\w#])[-+±]?\d[\d.,]*(e[-+]?\d+)?", "#", " ".join(text.split()))
    return re.sub(r"#(,? (and )?#)+", "#", masked)


def find_section(topic: Topic) -> str:
    return PAGE.partition(f"\n## {topic.title}\n")[2].partition("\n## ")[0]


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], tuple[int, str]]:
    """The exit status of a job, and all that it prints. Each is run once."""
    folder = tmp_path_factory.mktemp("bad")

    @cache
    def call(name: str) -> tuple[int, str]:
        words = ["run", f"jobs/bad_scans/{name}.yaml", "-o", str(folder / name)]
        with pytest.MonkeyPatch.context() as patch:
            patch.chdir(ROOT)
            done = CliRunner().invoke(app, words)
        if not isinstance(done.exception, DamageestError):
            return done.exit_code, done.output
        with redirect_stderr(io.StringIO()) as said:
            say_error(done.exception)
        return done.exception.exit_status, done.output + said.getvalue()

    return call


@pytest.mark.variants(slow=5)
@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=[] if name in FAST else pytest.mark.slow) for name in sorted({one for one, _ in QUOTED})],
)
def test_the_lines_of_a_job_are_what_it_prints(name: str, run: Callable[[str], tuple[int, str]]) -> None:
    said = mask(run(name)[1])
    for block in (text for one, text in QUOTED if one == name):
        for line in STARTS.split(block.strip()):
            assert mask(line) in said, f"the run does not say: {line}"


def test_each_job_is_quoted_and_each_picture_is_shown() -> None:
    assert {name for name, _ in QUOTED} == {path.stem for path in JOBS.glob("*.yaml")}
    image = import_or_skip("PIL.Image")
    shown = set(re.findall(r"\(images/(bad-scan-\w+\.png)\)", PAGE))
    drawn = sorted((ROOT / "docs" / "images").glob("bad-scan-*.png"))
    assert shown == {path.name for path in drawn}
    for path in drawn:
        assert path.stat().st_size < 60_000
        with image.open(path) as picture:
            assert picture.width == 700


@pytest.mark.parametrize("topic", TOPICS, ids=lambda topic: topic.word)
def test_its_section_has_the_words_of_the_command(topic: Topic) -> None:
    section = find_section(topic)
    assert f"`damageest explain {topic.word}`" in section
    assert " ".join(topic.text.split()) in " ".join(section.split())
    assert topic.job in section
    told = CliRunner().invoke(app, ["explain", topic.word]).output
    assert " ".join(topic.text.split()) in " ".join(told.split())
    assert all(line in told for line in topic.job.splitlines())


def test_each_code_of_a_topic_is_one_and_belongs_to_no_other() -> None:
    codes = [code for topic in TOPICS for code in topic.codes]
    known = {*(rule.code for rule in builtins.damageest_rules()), *RUN_CODES, *POSE_CODES, *STAGES}
    assert set(codes) <= known
    assert len(codes) == len(set(codes))
    assert len({topic.word for topic in TOPICS}) == len(TOPICS)


def test_every_rule_and_code_can_be_explained() -> None:
    codes = [*(rule.code for rule in builtins.damageest_rules()), *RUN_CODES, *POSE_CODES]
    done = CliRunner().invoke(app, ["explain", *codes])
    assert done.exit_code == 0
    for rule in builtins.damageest_rules():
        assert rule.meaning in " ".join(done.output.split())


def test_topics_are_listed_and_a_word_that_is_none_is_refused() -> None:
    listed = CliRunner().invoke(app, ["explain"]).output
    assert all(topic.word in listed and topic.title in listed for topic in TOPICS)
    done = CliRunner().invoke(app, ["explain", "nois"])
    assert "did you mean 'noise'?" in str(done.exception)


def list_help(said: str) -> list[str]:
    return [line for line in said.splitlines() if line.startswith("help: ")]


def test_a_refusal_names_its_topic_in_its_last_line(run: Callable[[str], tuple[int, str]]) -> None:
    status, said = run("unit")
    assert status == 2
    assert list_help(said) == ["help: damageest explain unit; see docs/bad-scan.md#the-unit-is-wrong"]
    assert said.splitlines()[-1] == list_help(said)[0]


@pytest.mark.slow
def test_a_run_with_doubts_names_its_topics_in_one_line(run: Callable[[str], tuple[int, str]]) -> None:
    status, said = run("mesh")
    assert status == 0
    assert list_help(said) == ["help: damageest explain sparse"]


@pytest.mark.slow
def test_a_sparse_scan_names_two_topics_in_one_line(tmp_path: Path) -> None:
    job = damaged_box.write(tmp_path, damaged_box.JOB.replace("tolerance: 0.2", "tolerance: 0.4"), 1000)
    done = CliRunner().invoke(app, ["run", str(job)])
    assert done.exit_code == 0
    assert list_help(done.output) == ["help: damageest explain sparse doubtful"]
