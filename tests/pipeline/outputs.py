"""An output folder with little in it, and its files."""

from __future__ import annotations

from pathlib import Path

from damageest.artefacts import Pose
from damageest.pipeline.workspace import open_workspace


def make(target: Path, body: str) -> None:
    """One finished output, its damage file holding ``body``."""
    with open_workspace(target) as place:
        place.cache.put("align", "k", Pose([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]))
        (place.folder / "result.json").write_text("{}")
        (place.folder / "damage.stl").write_text(body)
        (place.folder / "damage").mkdir()
        (place.folder / "damage/site-1.stl").write_text(body)
        place.finish(["align-k"])


def files(folder: Path) -> dict[str, str]:
    return {
        str(p.relative_to(folder)): p.read_text() for p in folder.rglob("*") if p.is_file() and "stages" not in p.parts
    }
