"""The committed job reference is the one that the code gives, and it describes every option."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

from damageest.job.reference import COMMAND, write_reference
from damageest.registry import Registry
from tests.job.test_schema import own
from tests.needs import PLUGINS, needs_plugin

PAGE = Path(__file__).parents[2] / "docs" / "job-reference.md"


@needs_plugin(*PLUGINS)
def test_the_job_reference_is_current(registry: Registry) -> None:
    current = write_reference(own(registry))
    assert PAGE.read_text() == current, f"run: {COMMAND}"


@pytest.mark.slow
def test_the_command_of_the_job_reference_writes_it() -> None:
    done = subprocess.run([sys.executable, "-m", "damageest.job.reference"], capture_output=True, text=True, check=True)
    assert done.stdout.startswith("<!-- Generated; do not edit.")
    assert COMMAND in done.stdout


def test_the_job_reference_describes_every_option(registry: Registry) -> None:
    text = write_reference(own(registry))
    for item in own(registry).implementations:
        section = text.partition(f"\n### {item.contract.stage}: {item.name}\n")[2].partition("\n### ")[0]
        for name in item.cls.model_fields:
            assert name == "use" or f"| `{name}` |" in section, f"{item.contract.stage}: {item.name}: {name}"
    undescribed = [line for line in text.splitlines() if re.match(r"\| `(?!tool)\w+` \|.*\|  \|$", line)]
    assert not undescribed, "options without a description"
