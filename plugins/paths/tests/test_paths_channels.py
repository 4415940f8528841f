"""Channels of the process: which pass gets what."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from pydantic import ValidationError

from damageest.stages.export import PathSettings
from damageest.stages.export.path_apt import write_apt
from damageest.stages.export.path_csv import write_csv
from tests.path_shapes import OPTIONS, dent, plan

TABLE = [
    {"set": {"power": 1200.0, "powder": 9.0}},
    {"layer": 1, "set": {"power": 1500.0, "speed": 480.0}},
    {"kind": "contour", "set": {"power": 1000.0}},
    {"layer": [2, 9], "first": True, "set": {"powder": 12.0}},
]


def test_each_pass_has_what_the_last_row_that_holds_for_it_says(tmp_path: Path) -> None:
    path = plan(dent(), simulate=False, direction=(0.0, 0.0, 1.0), pattern="offset-zigzag", process=TABLE)
    assert path.channels == ("power", "powder")
    assert path.values is not None
    kinds = np.array(path.kinds)[path.number - 1]
    is_contour = np.isin(kinds, ["ring", "rim"])
    assert is_contour.any()
    assert not is_contour.all()
    expected = np.where(is_contour, 1000.0, np.where(path.layer == 1, 1500.0, 1200.0))
    assert (path.values[:, 0] == expected).all()
    for layer in range(1, int(path.layer.max()) + 1):
        first = path.number[path.layer == layer].min()
        own = path.values[path.layer == layer, 1]
        assert (own == np.where((path.number[path.layer == layer] == first) & (layer > 1), 12.0, 9.0)).all()
    # a bead that is higher is as much slower
    feed = (path.feed * path.sizes[:, 1] / path.planned_sizes[:, 1])[path.on]
    assert np.allclose(feed, np.where(path.layer[path.on] == 1, 480.0, 600.0))
    assert (path.feed[~path.on] == 3000.0).all()
    write_csv(tmp_path / "a.csv", path, PathSettings("mm", "a"))
    lines = [line.split(",") for line in (tmp_path / "a.csv").read_text().splitlines()]
    assert lines[0][-3:] == ["power", "powder", "dwell"]
    assert np.array_equal(np.array([line[-3:-1] for line in lines[1:]], float), path.values)
    write_apt(tmp_path / "a.apt", path, PathSettings("mm", "a"))
    given, found = {}, []
    for line in (tmp_path / "a.apt").read_text().splitlines():
        if line.startswith(("INSERT/POWER ", "INSERT/POWDER ")):
            name, value = line.removeprefix("INSERT/").split()
            given[name.lower()] = float(value)
        elif line.startswith("GOTO"):
            found.append([given.get(name, np.nan) for name in path.channels])
    assert np.array_equal(np.array(found)[path.on], path.values[path.on])


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ([{"layer": 1, "set": {"power": 1.0}}], "power: has no value for all passes"),
        ([{"set": {"speed": 0.0}}], "speed"),
        ([{"set": {}}], "set"),
        ([{"set": {"Power": 1.0}}], "set"),
        ([{"layer": 0, "set": {"power": 1.0}}], "layer"),
    ],
)
def test_a_table_that_leaves_something_open_is_refused(table: list[dict[str, object]], words: str) -> None:
    from damageest_paths.layers import Layers

    with pytest.raises(ValidationError, match=words):
        Layers.model_validate({**OPTIONS, "process": table})
