"""What damageest reads beside parts, scans and plain jobs: a small sound file of each, as bytes, and how it is read."""

from __future__ import annotations

import re
import tempfile
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from damageest.artefacts import DepositPath
from damageest.errors import InputError
from tests import damaged_box
from tests.faults import seeds

PMI = """#9001=DATUM_FEATURE('Simple Datum.1',$,#9900,.T.);
#9002=DATUM('',$,#9900,.F.,'A');
#9003=SHAPE_ASPECT_RELATIONSHIP('',$,#9001,#9002);
#9004=GEOMETRIC_ITEM_SPECIFIC_USAGE('','DATUM',#9001,#9901,{first});
#9010=DATUM_REFERENCE_COMPARTMENT('',$,#9900,.F.,#9002,$);
#9012=DATUM_SYSTEM('',$,#9900,.F.,(#9010));
#9013=(LENGTH_MEASURE_WITH_UNIT()MEASURE_REPRESENTATION_ITEM()MEASURE_WITH_UNIT(LENGTH_MEASURE(0.6),#9902)
REPRESENTATION_ITEM(''));
#9014=SHAPE_ASPECT('','GDT',#9900,.T.);
#9015=GEOMETRIC_ITEM_SPECIFIC_USAGE('','GDT',#9014,#9901,{second});
#9016=(GEOMETRIC_TOLERANCE('Profile.1','',#9013,#9014)GEOMETRIC_TOLERANCE_WITH_DATUM_REFERENCE((#9012))
SURFACE_PROFILE_TOLERANCE());
#9900=PRODUCT_DEFINITION_SHAPE('','',$);
#9901=SHAPE_REPRESENTATION('',(),$);
#9902=NAMED_UNIT(*);
"""


def _pmi() -> bytes:
    text = seeds.seed("part.step").decode()
    faces = re.findall(r"#(\d+)\s*=\s*ADVANCED_FACE", text)
    head, end, tail = text.rpartition("ENDSEC;")
    return (head + PMI.format(first=f"#{faces[0]}", second=f"#{faces[1]}") + end + tail).encode()


def _machine(name: str) -> bytes:
    from damageest_machines.files import list_shipped

    return list_shipped()[name].read_bytes()


def _form() -> bytes:
    """A form as a run writes it: its arrays, deflated."""
    from damageest.artefacts import DisplacementField
    from damageest.io.forms import MeasuredForm, identify_part, write_form

    low, high = -np.array(damaged_box.SIZE) / 2, np.array(damaged_box.SIZE) / 2
    controls = np.random.default_rng(0).normal(scale=0.05, size=(4, 4, 4, 3))
    field = DisplacementField(low, high, controls)
    seen = seeds.points()[:50]
    form = MeasuredForm(field, seen, np.zeros(50), 3.0, "mm", 0.5, identify_part(damaged_box.box()), ("a" * 64,))
    with tempfile.TemporaryDirectory() as folder:
        write_form(Path(folder, "a.npz"), form)
        return Path(folder, "a.npz").read_bytes()


@cache
def output() -> dict[str, bytes]:
    """The files of a run's output folder, and the record of a repair in it."""
    import json

    import damageest
    from damageest.inspection.aim import read_aim
    from damageest.inspection.record import begin_record, hash_content

    with tempfile.TemporaryDirectory() as held:
        folder = Path(held)
        seeds.write_others(folder)
        job = seeds.make_job("points.npy")
        (folder / "job.yaml").write_text(job + "report: none\n")
        damageest.run(folder / "job.yaml", output=folder / "out")
        record = json.loads(json.dumps(begin_record(read_aim(folder / "out", "milled"))))
        record["sha256"] = hash_content(record)
        (folder / "out" / "record.json").write_text(json.dumps(record, indent=1))
        content = damaged_box.content(folder / "out")
    return {name: data for name, data in content.items() if not name.startswith("stages/")}


def _read_output(path: Path, registry: Any) -> None:
    """What `verify`, `picture`, `inspect` and the app read of an output folder."""
    from damageest.inspection.aim import read_aim
    from damageest.output.folder import open_output
    from damageest.output.verification import find_changes, find_other_versions

    folder = open_output(path.parent)
    folder.check_site(0)
    find_changes(path.parent, folder.content)
    find_other_versions(folder.content)
    assert folder.scan is not None
    read_aim(path.parent, "milled")


def _read_record(path: Path, registry: Any) -> None:
    from damageest.inspection.record import read_record

    read_record(path)


def _read_form(path: Path, registry: Any) -> None:
    from damageest.io.forms import read_form

    read_form(path)


def _read_machine(path: Path, registry: Any) -> None:
    """The machine, and the program of a short path for it."""
    from damageest_machines.files import read_machine
    from damageest_machines.lazy import list_writers

    from damageest.stages.export import PathSettings

    machine = read_machine(path)
    writer = list_writers()[{"kuka": "krl"}.get(path.stem.split("_")[1], "sinumerik")]
    writer.write(path.with_suffix(".out"), short_path(), PathSettings("mm", "fuzz", machine=path))
    assert machine


@cache
def short_path() -> DepositPath:
    """Two passes of three moves, deposited upright."""
    n = 6
    points = np.column_stack([np.tile([0.0, 10.0, 20.0], 2), np.repeat([0.0, 2.0], 3), np.ones(n)])
    up, ones = np.tile([0.0, 0.0, 1.0], (n, 1)), np.ones(n, np.int64)
    return DepositPath(
        points, up, up, np.full(n, 600.0), np.array([False, True, True] * 2), ones, np.repeat([1, 2], 3), ones, up[:1],
        np.ones(1), 2.0, np.ones(1), 3.0, 30.0, damaged_box.box(), 1.0, 1.0, kinds=("row", "row"),
    )  # fmt: skip


def _read_pmi(path: Path, registry: Any) -> None:
    from damageest.cli.part import read_pmi

    read_pmi(str(path), "mm", registry)


def _read_matrix(path: Path, registry: Any) -> None:
    from damageest.batches.jobs import find_jobs

    faults = [job.fault for job in find_jobs([path]) if job.fault]
    if faults:
        raise InputError(faults[0])


MATRIX = seeds.JOB + "matrix: {tolerance: [0.4, 0.5], cluster.neighbours: [8, 10], scan: '*.npy'}\n"
FILES: dict[str, tuple[Callable[[], bytes], Callable[[Path, Any], None]]] = {
    "pmi.step": (_pmi, _read_pmi),
    "machine_kuka.yaml": (lambda: _machine("kuka"), _read_machine),
    "machine_table.yaml": (lambda: _machine("sinumerik_table_table"), _read_machine),
    "adapt.npz": (_form, _read_form),
    "result.json": (lambda: output()["result.json"], _read_output),
    "scan.ply": (lambda: output()["scan.ply"], _read_output),
    "record.json": (lambda: output()["record.json"], _read_record),
    "matrix.yaml": (MATRIX.encode, _read_matrix),
}
"""Name of a file: its sound content, and what reads it."""
IN_OUTPUT = ("result.json", "scan.ply")
"""Files of an output folder: the others of it lie beside them."""


@cache
def find_seed(name: str) -> bytes:
    """The sound file of a name in FILES."""
    return FILES[name][0]()
