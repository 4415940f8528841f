"""Fixtures of all tests, those of the plugins too."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import trimesh

from damageest.registry import Registry


@pytest.fixture(scope="session")
def registry() -> Registry:
    return Registry.discover()


@pytest.fixture
def job_file(tmp_path: Path) -> Callable[..., Path]:
    """Writes a job file, beside a small box as part and a few points as scan."""
    trimesh.creation.box((40, 30, 20)).export(tmp_path / "box.stl")
    np.savetxt(tmp_path / "scan.xyz", np.random.default_rng(0).normal(size=(50, 3)))

    least = "version: 1\npart: box.stl\nscan: scan.xyz\n"

    def write(body: str = "", head: str = least) -> Path:
        path = tmp_path / "job.yaml"
        path.write_text(head + body)
        return path

    return write
