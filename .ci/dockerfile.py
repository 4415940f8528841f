"""Reads a Dockerfile, as far as this project's goes: its stages, and the steps of each."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

KNOWN = ("ARG", "CMD", "COPY", "ENTRYPOINT", "ENV", "RUN", "USER", "WORKDIR")


@dataclass
class Stage:
    """``source``: the stage or the image that it begins with. ``steps``: instruction and words, in their order."""

    name: str
    source: str
    steps: list[tuple[str, str]] = field(default_factory=list)

    def needs(self) -> set[str]:
        """The stages and images that it takes something of."""
        copied = (re.search(r"--from=(\S+)", words) for step, words in self.steps if step == "COPY")
        return {self.source, *(found.group(1) for found in copied if found)}

    def find_last(self, step: str) -> str:
        """The words of the last step of a kind; empty where there is none."""
        return next((words for kind, words in reversed(self.steps) if kind == step), "")


def read(path: Path) -> dict[str, Stage]:
    """The stages by their names. Raises ValueError for an instruction that is not known here."""
    lines = [line for line in path.read_text().splitlines() if not line.lstrip().startswith("#")]
    text = re.sub(r"\\\n", " ", "\n".join(lines))
    stages: dict[str, Stage] = {}
    values: dict[str, str] = {}
    for line in filter(None, map(str.strip, text.splitlines())):
        step, words = line.split(maxsplit=1)
        if step == "FROM":
            source, _, name = words.partition(" AS ")
            stages[name] = Stage(name, fill(source, values))
        elif step not in KNOWN:
            raise ValueError(f"{path}: the instruction {step} is not known")
        elif not stages:
            values |= dict([words.split("=", 1)])
        else:
            list(stages.values())[-1].steps.append((step, " ".join(words.split())))
    return stages


def fill(words: str, values: Mapping[str, str]) -> str:
    """Words with ``${NAME}`` replaced."""
    return re.sub(r"\$\{(\w+)\}", lambda found: values.get(found.group(1), found.group(0)), words)


def read_pairs(words: str) -> dict[str, str]:
    """The names and values of an ENV or ARG."""
    return dict(pair.split("=", 1) for pair in words.split())


def inherit(stages: Mapping[str, Stage], name: str, step: str) -> str:
    """The words of the last step of a kind in a stage, or in what it begins with."""
    stage = stages.get(name)
    return "" if stage is None else stage.find_last(step) or inherit(stages, stage.source, step)


def read_list(words: str) -> list[str]:
    """The words of an ENTRYPOINT or a CMD."""
    return [str(word) for word in json.loads(words)]
