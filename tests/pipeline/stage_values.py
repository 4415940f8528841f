"""A valid value of each contract, and a stage that gives whatever it is told to, called by the engine."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal

import numpy as np
from pydantic import Field

from damageest.artefacts import (
    AdaptedPart,
    Deposit,
    DepositPath,
    Enclosure,
    Enclosures,
    Mesh,
    Pose,
    Unreached,
)
from damageest.conformance import _scene
from damageest.job import Job
from damageest.pipeline.engine import Engine
from damageest.pipeline.state import Candidate, JobState
from damageest.registry import Registry
from damageest.registry.contracts import DEFAULTS, Contract
from damageest.registry.loading import Provider
from damageest.registry.registry import Implementation
from damageest.stages.export import ExportedFiles
from damageest.stages.report import ReportFiles

ACME = Provider("acme", "1.2", "MIT", "tests")
NAMES = {contract.__name__: contract for contract in DEFAULTS}


@lru_cache
def make_given(folder: Path) -> dict[str, Any]:
    """All inputs of all contracts."""
    (folder / "a.txt").touch()
    damage = _scene.make_dent(0)
    scene = vars(_scene.make_scene())
    more = {"damage": damage, "body": damage, "solid": scene["background"], "left": None, "built": None}
    return {**scene, **more, "enclosure": scene["background"], "others": None, "folder": folder}


@lru_cache
def make_valid(folder: Path) -> dict[str, Any]:
    """A valid value of each contract, by its class's name."""
    given = make_given(folder)
    damage, background = given["damage"], given["background"]
    count = len(given["part"].vertices)
    up = np.tile([0.0, 0.0, 1.0], (3, 1))
    path = DepositPath(
        np.arange(9.0).reshape(3, 3), up, up, np.full(3, 60.0), np.array([False, True, True]), np.ones(3, int),
        np.ones(3, int), np.ones(3, int), up[:1], np.ones(1), 2.0, np.ones(1), 1.0, 10.0, damage, 0.1, np.inf,
        up[:2], (Unreached(1.0, "unsupported"),), damage,
    )  # fmt: skip
    viewed = dataclasses.replace(
        given["scan"], viewpoints=np.full((2, 3), 50.0), view=np.zeros(len(given["scan"].points), np.int32)
    )
    return {
        "ReadPart": dataclasses.replace(given["part"], faces_brep=np.zeros(len(given["part"].faces), int)),
        "ReadScan": viewed,
        "Sample": given["samples"],
        "Align": Pose(np.eye(4), 0.1, 0.9, np.eye(4)[None]),
        "Adapt": AdaptedPart(
            given["part"],
            np.zeros((count, 3)),
            np.eye(4),
            np.zeros((2, count, 3)),
            0.3,
            0.1,
            0.01,
            0.01,
            (4, 3, 2),
            other=np.zeros((count, 3)),
        ),
        "Segment": given["deviation"],
        "Cluster": given["sites"],
        "Reconstruct": given["surface"],
        "Boundary": given["rims"],
        "Background": background,
        "Enclose": Mesh(background.vertices, background.faces),
        "EncloseAll": Enclosures((Enclosure(background, (1, 2)),)),
        "Repair": background,
        "Boolean": damage,
        "Allowance": Deposit(damage.vertices, damage.faces, damage, 0.1, 0.1, (0.1, 0.2, 0.3)),
        "Path": path,
        "Export": ExportedFiles(("a.txt",)),
        "Report": ReportFiles(("a.txt",)),
    }


def call(
    contract: Contract, make: Callable[[], Any], registry: Registry, folder: Path, give_engine: bool = False
) -> Any:
    """What the engine gives for a stage whose ``run`` gives ``make()``; or the engine."""
    fields = {"use": (Literal["fake"], "fake"), "make": (Any, Field(None, exclude=True))}
    annotations = {name: kind for name, (kind, _) in fields.items()}
    defaults = {name: default for name, (_, default) in fields.items()}

    def run(self: Any) -> Any:
        return self.make()

    cls: Any = type("Fake", (contract,), {"__annotations__": annotations, "run": run, **defaults})
    stage = cls.model_construct(use="fake", make=make)
    item = Implementation("fake", cls, contract, ACME)
    job = Job("job", "mm", None, "auto", {contract: stage}, {contract: item}, folder, "job")
    given = make_given(folder)
    keys = dict.fromkeys(given, "k")
    state = Candidate({}, {}, job=JobState(given, keys), number=1)
    engine = Engine(job, registry)
    if give_engine:
        return engine
    place: Any = state if contract.per_site else state.job
    done: Any = engine.call(contract, place)
    return done.get(contract.gives)
