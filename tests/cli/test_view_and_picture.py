"""`damageest view` and `damageest picture` on the output of a run."""

from __future__ import annotations

import shutil
import subprocess
import sys
import webbrowser
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import damageest
from damageest.artefacts import Mesh
from damageest.errors import InputError, JobError, StageError
from damageest.io.meshes import write_ply
from damageest.output import pictures
from damageest.output.folder import OutputFolder, open_output
from tests import damaged_box


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    home = tmp_path_factory.mktemp("box")
    job = damaged_box.write_small(home, "export: {format: [stl, 3mf], frame: both}\n")
    damageest.run(job, output=home / "out")
    return home / "out"


def test_what_was_written_is_read_again(folder: Path) -> None:
    output = open_output(folder)
    assert output.site_numbers == [1]
    damage, left, skin = output.read_solid("damage", 1), output.read_solid("undamaged"), output.read_mesh("skin.ply")
    assert damage
    assert left
    assert skin
    assert damage.bounds[0, 2] > 3
    assert np.ptp(left.bounds, axis=0) == pytest.approx(damaged_box.SIZE, abs=1e-3)
    assert output.scan
    assert len(output.scan.points) == 6000
    assert (output.scan.site == 1).sum() == output.content["sites"][0]["points"]
    assert output.scan.distance[output.scan.site == 1].min() == pytest.approx(-output.content["sites"][0]["max_depth"])


def test_solids_of_a_3mf_file_are_found_by_name(folder: Path, tmp_path: Path) -> None:
    shutil.copytree(folder / "scan_frame", tmp_path / "scan_frame", ignore=shutil.ignore_patterns("*.stl"))
    shutil.copy(folder / "result.json", tmp_path)
    output, usual = open_output(tmp_path), open_output(folder)
    assert output.place == tmp_path / "scan_frame"
    for kind, site in (("damage", 1), ("undamaged", 0)):
        found, expected = output.read_solid(kind, site), usual.read_solid(kind, site)
        assert found
        assert expected
        assert found.area == pytest.approx(expected.area, rel=1e-4)


def test_view_opens_the_report_at_the_site(folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: object) -> None:
    from damageest.cli.view import command

    opened: list[str] = []
    monkeypatch.setattr(webbrowser, "open", lambda address: opened.append(address) or True)
    with pytest.raises(InputError, match=r"no report\.html"):
        command(folder, 0, False)
    (folder / "report.html").write_text("")
    command(folder, 1, False)
    assert opened == [f"{(folder / 'report.html').as_uri()}#site-1"]
    with pytest.raises(InputError, match=r"no site 7; there are: 1"):
        command(folder, 7, False)
    with pytest.raises(InputError, match=r"no result\.json"):
        command(folder.parent, 0, False)


def test_a_window_needs_a_display(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    with pytest.raises(StageError, match="no display"):
        pictures.open_window(open_output(folder), 0)


class Window:
    """What `open_window` needs of a plotter, without OpenGL."""

    def __init__(self, **_: object) -> None:
        self.scalar_bars: dict[str, Any] = {}
        self.switches: list[tuple[Any, bool]] = []
        self.names: list[str] = []
        self.actors: list[Any] = []
        self.camera = SimpleNamespace(zoom=lambda factor: None)

    def add_mesh(self, *_: object, **look: Any) -> Any:
        self.actors.append(SimpleNamespace(visibility=True))
        return self.actors[-1]

    def add_checkbox_button_widget(self, switch: Any, value: bool, **_: object) -> None:
        self.switches.append((switch, value))

    def add_text(self, name: str, **_: object) -> None:
        self.names.append(name)

    def __getattr__(self, name: str) -> Any:
        return lambda *_, **__: None


@pytest.mark.slow
def test_each_layer_of_the_window_has_a_switch(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Which layers are shown at first, and that each switch shows and hides its own."""
    import pyvista

    opened: list[Window] = []
    monkeypatch.setenv("DISPLAY", ":99")
    monkeypatch.setattr(pyvista, "Plotter", lambda **named: opened.append(Window(**named)) or opened[-1])
    pictures.open_window(open_output(folder), 1)
    (window,) = opened
    shown = {name: value for name, (_, value) in zip(window.names, window.switches, strict=True)}
    assert {name for name, on in shown.items() if on} == {"part", "damage volumes"}
    assert {name for name, on in shown.items() if not on} == {"inner damage surfaces", "scan", "damage points"}
    for switch, on in window.switches:
        before = [actor.visibility for actor in window.actors]
        switch(not on)
        changed = [k for k, actor in enumerate(window.actors) if actor.visibility != before[k]]
        assert changed
        assert all(window.actors[k].visibility is not on for k in changed)
        switch(on)
        assert [actor.visibility for actor in window.actors] == before


@pytest.mark.slow
@pytest.mark.skipif(not shutil.which("xvfb-run"), reason="there is no virtual display: apt-get install xvfb xauth")
def test_each_switch_of_the_window_changes_what_is_shown(folder: Path) -> None:
    script = [sys.executable, "-m", "tests.cli.windowed", str(folder)]
    told = subprocess.run(["xvfb-run", "-a", *script], capture_output=True, text=True, timeout=120, check=False)
    assert told.returncode == 0, told.stderr
    kinds, counts = zip(*(line.split() for line in told.stdout.splitlines()), strict=True)
    assert kinds[0] == "colours"
    assert int(counts[0]) > 100
    assert len(counts) >= 6  # part, damage volumes, surfaces, deposits, scan, points
    assert all(int(count) > 50 for count in counts[1:])


def draw(picture: pictures.Picture, path: Path) -> np.ndarray:
    """The colours of the picture. Skips the test where there is no OpenGL."""
    from PIL import Image

    try:
        pictures.draw_picture(picture, path)
    except StageError as error:
        pytest.skip(str(error))
    return np.asarray(Image.open(path).convert("RGB")).astype(int)


def find_red(image: np.ndarray) -> np.ndarray:
    return (image[..., 0] > image[..., 1] + 40) & (image[..., 0] > image[..., 2] + 20)


@pytest.fixture(scope="module")
def image(folder: Path, tmp_path_factory: pytest.TempPathFactory) -> np.ndarray:
    picture = pictures.Picture((open_output(folder),), (1,), ("damage",), "z", (160, 120))
    return draw(picture, tmp_path_factory.mktemp("picture") / "new/picture.png")


def test_a_picture_has_its_size_and_shows_the_part(image: np.ndarray) -> None:
    assert image.shape == (120, 160, 3)
    assert (image.min(axis=2) < 240).mean() > 0.05


def test_a_picture_shows_the_damage(image: np.ndarray) -> None:
    assert find_red(image).sum() > 20


@pytest.mark.slow
def test_a_picture_has_a_column_for_each_folder_and_a_row_for_each_look(folder: Path, tmp_path: Path) -> None:
    output = open_output(folder)
    looks = ("deviation", "damage")
    image = draw(pictures.Picture((output, output), (0, 1), looks, None, (160, 120)), tmp_path / "picture.png")
    assert image.shape == (2 * 120, 2 * 160, 3)
    red = find_red(image)
    for column in (0, 1):
        own = image[:, 160 * column : 160 * (column + 1)]
        for row in range(2):
            assert (own[120 * row : 120 * (row + 1)].min(axis=2) < 240).mean() > 0.05, (row, column)
        assert red[120:, 160 * column : 160 * (column + 1)].sum() > 20
    assert red[120:, 160:].sum() > 3 * red[120:, :160].sum(), "the site is seen from near"


@pytest.mark.slow
def test_a_picture_shows_the_path_and_what_it_does_not_reach(folder: Path, tmp_path: Path) -> None:
    from PIL import Image

    from damageest.cli.picture import command

    shutil.copytree(folder, tmp_path / "out")
    options = {"site": [1], "side": "z", "show": ["path"], "size": "160x120", "debug": False}
    with pytest.raises(JobError, match=r"no path/site-\*\.csv"):
        command([tmp_path / "out"], output=tmp_path / "p.png", **options)  # type: ignore[arg-type]
    path, body = tmp_path / "out/path", open_output(folder).read_solid("damage", 1)
    assert body
    path.mkdir()
    low, high = body.bounds
    rows = [f"{x},{low[1]},{high[2] + 1},0,0,1,9,{on},1,1,1,1,1,row" for x, on in ((low[0], 0), (high[0], 1))]
    (path / "site-1.csv").write_text("\n".join(["x,y,z,i,j,k,feed,on,layer,pass,part,width,height,kind", *rows]) + "\n")
    write_ply(path / "site-1.unreached.ply", Mesh(body.vertices + np.array([0, 0, 1]), body.faces))
    try:
        command([tmp_path / "out"], output=tmp_path / "p.png", **options)  # type: ignore[arg-type]
    except StageError as error:
        pytest.skip(str(error))
    image = np.asarray(Image.open(tmp_path / "p.png").convert("RGB")).astype(int)
    red = (image[..., 0] > image[..., 1] + 80) & (image[..., 0] > image[..., 2] + 80)
    violet = (image[..., 2] > image[..., 1] + 25) & (image[..., 0] > image[..., 1] + 15)
    assert red.sum() > 100
    assert violet.sum() > 20


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"side": "left"}, "there are: iso, x, y, z"),
        ({"show": ["damages"]}, "did you mean 'damage'"),
        ({"size": "9x"}, "'9x' is not a size"),
        ({"site": [1, 1]}, "given 2 times for 1 folders"),
        ({"output": Path("picture.jpg")}, "name it with .png"),
    ],
)
def test_wrong_options_are_named(given: dict[str, object], said: str, folder: Path) -> None:
    from damageest.cli.picture import command

    options = {"output": Path("p.png"), "site": None, "side": None, "show": None, "size": "90x70", "debug": False}
    with pytest.raises(JobError, match=said):
        command([folder], **{**options, **given})  # type: ignore[arg-type]


def test_a_folder_with_half_a_result_is_refused(tmp_path: Path) -> None:
    (tmp_path / "result.json").write_text('{"sites": 1}')
    with pytest.raises(InputError, match="cannot be read as a result"):
        open_output(tmp_path)
    assert OutputFolder(tmp_path, {}).read_solid("damage", 1) is None
