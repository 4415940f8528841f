"""Fixtures of all tests, those of the plugins too."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
import trimesh

from damageest.registry import Registry


@pytest.fixture(scope="session", autouse=True)
def part_store(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """What is kept of parts goes to a folder of the session, not to the user's."""
    folder = tmp_path_factory.mktemp("kept") / "parts"
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("DAMAGEEST_CACHE", str(folder))
        yield folder


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
