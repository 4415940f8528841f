"""`damageest nominal`: the mean of measured parts as a file."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from damageest.artefacts import fit_displacement
from damageest.cli import app
from damageest.errors import DamageestError
from damageest.io.forms import MeasuredForm, identify_part, read_form, write_form
from damageest.io.meshes import read_mesh
from damageest.io.parts import read_part
from tests import damaged_box

AMOUNTS = (0.5, 1.0, 1.5)


def write_runs(folder: Path) -> list[str]:
    """Output folders of runs on parts that are bent by these amounts."""
    damaged_box.write_small(folder)
    part = read_part(folder / "box.stl", "mm")
    seen = np.random.default_rng(0).uniform(*part.bounds, (2000, 3))
    for number, amount in enumerate(AMOUNTS):
        field = fit_displacement(
            lambda at, a=amount: a * (at[:, :1] / 20) ** 2 * np.array([0.0, 0.0, 1.0]), *part.bounds, (2, 1, 1)
        )
        out = folder / f"out-{number}"
        out.mkdir()
        (out / "job.yaml").write_text((folder / "job.yaml").read_text().replace("box.stl", "../box.stl"))
        write_form(out / "adapt.npz", MeasuredForm(field, seen, np.zeros(2000), 3.0, "mm", 0.2, identify_part(part)))
    return [str(folder / f"out-{number}") for number in range(len(AMOUNTS))]


@pytest.mark.variants(1)
@pytest.mark.parametrize("suffix", ["stl", "ply"])
def test_the_mean_of_three_parts(suffix: str, tmp_path: Path) -> None:
    path = tmp_path / f"new/mean.{suffix}"
    done = CliRunner().invoke(app, ["nominal", *write_runs(tmp_path), "-o", str(path)])
    assert done.exit_code == 0, done.output
    assert "the mean of 3 parts" in done.output
    vertices, _, _ = read_mesh(path)
    middle, end = (vertices[np.abs(np.abs(vertices[:, 0]) - at) < 1] for at in (0.5, 20))
    bent = end[:, 2].max() - middle[:, 2].max()
    assert bent == pytest.approx(np.mean(AMOUNTS), abs=0.05)
    form = read_form(path.with_suffix(".npz"))
    assert form.unit == "mm"
    assert len(form.seen) > 1000


@pytest.mark.parametrize(
    ("kind", "said"), [("suffix", "neither STL nor PLY"), ("folder", "there is no such file"), ("job", "no job.yaml")]
)
def test_what_it_refuses(kind: str, said: str, tmp_path: Path) -> None:
    runs = write_runs(tmp_path)
    output = tmp_path / ("mean.obj" if kind == "suffix" else "mean.stl")
    if kind == "job":
        (Path(runs[0]) / "job.yaml").unlink()
    runs = [*runs, str(tmp_path / "nothing")] if kind == "folder" else runs
    done = CliRunner().invoke(app, ["nominal", *runs, "-o", str(output)])
    assert isinstance(done.exception, DamageestError)
    assert said in str(done.exception)
    assert not output.exists()
