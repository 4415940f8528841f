"""Generated pages and sections are those that the code gives; the page of each stage has a job that runs."""

from __future__ import annotations

import importlib.util
import re
import shutil
from pathlib import Path
from types import ModuleType

import pytest

import damageest
from damageest.registry import Registry
from damageest.registry.contracts import STAGES
from tests.job.test_schema import own
from tests.needs import PLUGINS, needs_plugin

ROOT = Path(__file__).parents[1]
PAGES = {stage: (ROOT / "docs" / "stages" / f"{stage}.md").read_text() for stage in STAGES}


def load_writer() -> ModuleType:
    spec = importlib.util.spec_from_file_location("make_reference", ROOT / "docs" / "make_reference.py")
    assert spec
    assert spec.loader
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


WRITER = load_writer()


def read_hand_written(stage: str) -> str:
    """What stands above the frame, without the job."""
    return re.sub(r"```yaml\n.*?```", "", PAGES[stage].partition("<!-- frame: begin -->")[0], flags=re.DOTALL)


@needs_plugin(*PLUGINS)
def test_the_generated_pages_are_current(registry: Registry) -> None:
    for path, text in WRITER.write_pages(own(registry)).items():
        assert path.read_text() == text, f"{path.name}: run: {WRITER.COMMAND}"


def test_a_page_without_marks_is_refused() -> None:
    with pytest.raises(ValueError, match="frame: begin"):
        WRITER.fill("# Page\n", "frame", "text")


def test_every_stage_has_one_page() -> None:
    assert {path.stem for path in (ROOT / "docs" / "stages").glob("*.md")} == set(STAGES)


@pytest.mark.parametrize("stage", STAGES)
def test_a_page_says_in_two_sentences_when_to_take_a_stage(stage: str) -> None:
    head, text = read_hand_written(stage).strip().split("\n", 1)
    assert head == f"# {stage}"
    assert len(re.findall(r"\.(?:\s|$)", text)) == 2
    assert len(text.split()) <= 45


@pytest.mark.slow
@needs_plugin(*PLUGINS)
@pytest.mark.parametrize("stage", STAGES)
def test_the_job_of_a_stage_runs(stage: str, tmp_path: Path) -> None:
    (job,) = re.findall(r"```yaml\n(.*?)```", PAGES[stage], re.DOTALL)
    for name in ("parts/block.stl", "scans/block_wedge.ply"):
        (tmp_path / name).parent.mkdir()
        shutil.copy(ROOT / "jobs" / name, tmp_path / name)
    (tmp_path / "job.yaml").write_text(job)
    result = damageest.run(tmp_path / "job.yaml", output=True)
    (site,) = result.sites
    assert site.accepted
    if truth := result.to_dict()["truth"]:
        assert truth["iou"] > 0.8
