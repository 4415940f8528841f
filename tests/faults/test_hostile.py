"""Files made to do harm, one by one: each is refused in words, in little time and memory."""

from __future__ import annotations

import io
import os
import re
import struct
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
import trimesh

from tests.faults import seeds
from tests.faults.run import Row, Worker
from tests.needs import needs_plugin


@pytest.fixture(scope="module")
def worker() -> Iterator[Worker]:
    one = Worker()
    one.start()
    yield one
    one.stop()


def try_file(worker: Worker, folder: Path, name: str, data: bytes) -> Row:
    seeds.write_others(folder)
    (folder / name).write_bytes(data)
    (folder / "job.yaml").write_text(seeds.make_job(name))
    return worker.try_job(folder / "job.yaml")


def repack(change: Callable[[bytes], bytes] = lambda model: model, more: int = 0) -> bytes:
    """The sound 3MF with another model, or with ``more`` bytes of zeros beside it."""
    stream = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(seeds.seed("part.3mf"))) as old, zipfile.ZipFile(stream, "w", 8) as new:
        for name in old.namelist():
            new.writestr(name, change(old.read(name)) if name.endswith(".model") else old.read(name))
        with new.open("more.bin", "w", force_zip64=True) as rest:
            for _ in range(more >> 20):
                rest.write(bytes(1 << 20))
    return stream.getvalue()


def put(name: str, at: int, raw: bytes) -> bytes:
    data = seeds.seed(name)
    return data[:at] + raw + data[at + len(raw) :]


def nest(model: bytes) -> bytes:
    """Objects that each place the one before ten times: ten to the power of twelve bodies."""
    last = re.findall(rb'<object id="(\d+)"', model)[-1]
    objects = b""
    for number in range(1000, 1012):
        one = b'<component objectid="%s"/>' % last
        objects += b'<object id="%d" type="model"><components>%s</components></object>' % (number, one * 10)
        last = b"%d" % number
    return model.replace(b"</resources>", objects + b"</resources>").replace(
        b"</build>", b'<item objectid="1011"/></build>'
    )


def nest_in_a_chain(model: bytes, count: int = 3000) -> bytes:
    """Objects that each place the one before once: one body."""
    last = re.findall(rb'<object id="(\d+)"', model)[-1]
    objects = b""
    for number in range(1000, 1000 + count):
        inside = b'<components><component objectid="%s"/></components>' % last
        objects += b'<object id="%d" type="model">%s</object>' % (number, inside)
        last = b"%d" % number
    model = model.replace(b"</resources>", objects + b"</resources>")
    return re.sub(rb"<item [^>]*/>", b'<item objectid="%s"/>' % last, model, count=1)


def nest_in_itself(model: bytes) -> bytes:
    last = re.findall(rb'<object id="(\d+)"', model)[-1]
    inside = b'<components><component objectid="7"/><component objectid="%s"/></components>' % last
    model = model.replace(b"</resources>", b'<object id="7" type="model">%s</object></resources>' % inside)
    return model.replace(b"</build>", b'<item objectid="7"/></build>')


def declare(model: bytes) -> bytes:
    """The same with XML entities."""
    entities = b"".join(b'<!ENTITY %c "%s">' % (98 + k, b"&%c;" % (97 + k) * 10) for k in range(9))
    head = b'<!DOCTYPE model [<!ENTITY a "' + b"x" * 100 + b'">' + entities + b"]>"
    return model.replace(b"<model", head + b"<model", 1).replace(
        b"<resources>", b'<metadata name="t">&j;</metadata><resources>', 1
    )


def npy(shape: str) -> bytes:
    text = f"{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}, }}".ljust(117) + "\n"
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(text)) + text.encode() + bytes(240)


HOSTILE: dict[str, tuple[str, Callable[[], bytes], str]] = {
    "LAS with four thousand million records": ("a.las", lambda: put("scan.las", 100, b"\xff" * 4), "no room for"),
    "LAZ with four thousand million records": ("a.laz", lambda: put("scan.laz", 100, b"\xff" * 4), "no room for"),
    "LAS with as many points": ("a.las", lambda: put("scan.las", 107, b"\xff" * 4), "truncated"),
    "LAS with a scale of 1e300": ("a.las", lambda: put("scan.las", 131, struct.pack("<3d", *[1e300] * 3)), "no points"),
    "3MF that packs 60 MB": ("part.3mf", lambda: repack(more=60 << 20), "far more than meshes"),
    "3MF of 100,000 items": (
        "part.3mf",
        lambda: repack(lambda m: re.sub(rb"(<item [^>]*/>)", lambda one: one[1] * 100_000, m)),
        "packed|bodies",
    ),
    "3MF of 5,000 items": (
        "part.3mf",
        lambda: repack(lambda m: re.sub(rb"(<item [^>]*/>)", lambda one: one[1] * 5_000, m)),
        "more than 1000 bodies",
    ),
    "3MF of nested objects": ("part.3mf", lambda: repack(nest), "more than 1000 bodies"),
    "3MF of 3,000 objects inside each other": ("part.3mf", lambda: repack(nest_in_a_chain), "3001 of its objects"),
    "3MF of an object inside itself": ("part.3mf", lambda: repack(nest_in_itself), "contains itself"),
    "3MF of nested entities": ("part.3mf", lambda: repack(declare), "declares entities"),
    "NPY of 10^18 points": ("a.npy", lambda: npy("(1000000000000000000, 3)"), "its header has the shape"),
    "NPY of fewer than no points": ("a.npy", lambda: npy("(-4, 3)"), "its header has the shape"),
    "PLY of 10^18 points": (
        "a.ply",
        lambda: seeds.seed("little.ply").replace(b"vertex 600", b"vertex 1000000000000000000"),
        "truncated",
    ),
    "PCD of 10^18 points": (
        "a.pcd",
        lambda: seeds.seed("binary.pcd").replace(b"POINTS 600", b"POINTS 1000000000000000000"),
        "truncated",
    ),
    "coordinates of 1e300": ("a.xyz", lambda: b"1e300 1e300 1e300\n" * 50, "no points"),
    "E57 with entities": (
        "a.e57",
        lambda: seeds.seed("scan.e57").replace(b'<?xml version="1.0" encoding="UTF-8"?>', b"<!DOCTYPE a>".ljust(38)),
        "declares entities|cannot be read",
    ),
}


@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_files_are_refused(name: str, worker: Worker, tmp_path: Path) -> None:
    file, make, words = HOSTILE[name]
    row = try_file(worker, tmp_path, file, make())
    assert row["outcome"] == "refused", row
    assert re.search(words, row["words"]), row["words"]
    assert file in row["words"]
    assert row["peak"] < 500e6


def test_a_part_of_1e300(worker: Worker, tmp_path: Path) -> None:
    row = try_file(worker, tmp_path, "part.obj", re.sub(rb"-20\.\d*", b"-1e300", seeds.seed("part.obj")))
    assert row["outcome"] == "refused"
    assert "coordinates above 1e+12" in row["words"]


def test_a_file_with_holes_is_refused(worker: Worker, tmp_path: Path) -> None:
    """Its size says 24 GB, of which a few bytes were ever written."""
    seeds.write_others(tmp_path)
    head = npy("(1000000000, 3)")
    (tmp_path / "a.npy").write_bytes(head)
    os.truncate(tmp_path / "a.npy", len(head) + 24 * 10**9)
    (tmp_path / "job.yaml").write_text(seeds.make_job("a.npy"))
    row = worker.try_job(tmp_path / "job.yaml")
    assert row["outcome"] == "refused"
    assert "were ever written" in row["words"]
    assert row["peak"] < 500e6


def comment(name: str) -> bytes:
    """The sound PLY with comments before the format."""
    return seeds.seed(name).replace(b"format", b"comment made by hand\nobj_info no format\nformat", 1)


UNUSUAL: dict[str, tuple[str, Callable[[], bytes], str]] = {
    "LAZ with one piece of any size": ("a.laz", lambda: _put_piece(4294967294), "scan.laz"),
    "3MF of 50 objects inside each other": ("part.3mf", lambda: repack(lambda m: nest_in_a_chain(m, 50)), "part.3mf"),
    "scan as PLY text, comment first": ("a.ply", lambda: comment("ascii.ply"), "ascii.ply"),
    "scan as PLY, comment first": ("a.ply", lambda: comment("little.ply"), "little.ply"),
    "part as PLY, comment first": ("part.ply", lambda: comment("part.ply"), "part.ply"),
    "part as PLY text, comment first": ("part.ply", lambda: _as_text().replace(b"format", b"comment\nformat", 1), ""),
}


def _put_piece(size: int) -> bytes:
    """The sound LAZ, whose pieces are said to have ``size`` points."""
    return put("scan.laz", seeds.seed("scan.laz").index(b"laszip encoded") + 64, struct.pack("<I", size))


def _as_text() -> bytes:
    mesh = trimesh.load(io.BytesIO(seeds.seed("part.ply")), file_type="ply", process=False)
    return bytes(mesh.export(file_type="ply", encoding="ascii"))


@pytest.mark.parametrize("name", UNUSUAL)
def test_unusual_files_are_read(name: str, worker: Worker, tmp_path: Path) -> None:
    file, make, sound = UNUSUAL[name]
    row = try_file(worker, tmp_path, file, make())
    assert row["outcome"] == "done", row
    usual = try_file(worker, tmp_path, sound or file, seeds.seed(sound) if sound else _as_text())
    assert (row["points"], row["volume"]) == (usual["points"], usual["volume"])


@pytest.mark.parametrize("size", [0, 1, 7, 599, 2**31 - 1, 2**32 - 2, 2**32 - 1])
def test_pieces_of_any_size_in_a_laz_file(size: int, worker: Worker, tmp_path: Path) -> None:
    row = try_file(worker, tmp_path, "a.laz", _put_piece(size))
    assert row["outcome"] in ("done", "refused"), row


def _shuffle(data: bytes) -> bytes:
    """STEP whose references go to other entities."""
    names = re.findall(rb"#\d+", data)
    rng = np.random.default_rng(0)
    other = iter(rng.permutation(len(names)))
    head, body = data.split(b"DATA;", 1)
    return head + b"DATA;" + re.sub(rb"(?<=[(,])#\d+", lambda _: names[next(other)], body)


NATIVE = {
    "STEP with shuffled references": ("part.step", lambda: _shuffle(seeds.seed("part.step"))),
    "STEP with NaN": ("part.step", lambda: re.sub(rb"(?<=[(,])-?20\.", b"NaN", seeds.seed("part.step"))),
    "IGES cut short": ("part.iges", lambda: seeds.seed("part.iges")[:20_000]),
    "IGES with NaN": ("part.iges", lambda: re.sub(rb"(?<=,)-?20\.", b"NaN", seeds.seed("part.iges"))),
    "BREP cut short": ("part.brep", lambda: seeds.seed("part.brep")[:5_000]),
}


@needs_plugin("cadquery")
@pytest.mark.slow  # the cheap ones are in tests/isolation/test_worker.py and those of plugin cadquery
@pytest.mark.parametrize("name", NATIVE)
def test_a_reader_that_crashes_or_hangs_is_the_files_fault(name: str, worker: Worker, tmp_path: Path) -> None:
    file, make = NATIVE[name]
    row = try_file(worker, tmp_path, file, make())
    assert row["outcome"] == "refused", row
    assert file in row["words"]


ALIASES = ("ab", "bc", "cd", "de", "ef", "fg")
JOBS: dict[str, tuple[str, str]] = {
    "deep": ("x: " + "[" * 20_000, "inside each other"),
    "many": ("x: [" + "1," * 25_000 + "1]", "more than 20000 values"),
    "aliases": (
        "a: &a [1,1,1,1,1,1,1,1,1,1]\n" + "".join(f"{k}: &{k} [{f'*{j},' * 10}1]\n" for j, k in ALIASES),
        "aliases",
    ),
    "a type of Python": ("part: !!python/object/apply:os.system [ls]", "the tag !!python"),
    "another tag": ("part: !x box.stl", "the tag !x"),
    "NUL in a path": ('part: "bo\\0x.stl"', "NUL"),
    "a path that is too long": ("part: " + "a" * 5000 + ".stl", "File name too long"),
    "a link to itself": ("part: loop.stl", "leads nowhere"),
    "a pipe": ("part: pipe.stl", "a pipe or a device"),
    "nobody's home": ("part: ~nobody_at_all/box.stl", "there is no such file"),
    "a name that leaves the folder": ("name: ../../x", "name"),
    "a name that is the folder above": ("name: ..", "do not name a folder"),
    "a tolerance of 1e-300": ("tolerance: 1e-300", "does not fit a part"),
    "a tolerance of 1e300": ("tolerance: 1e300", "does not fit a part"),
    "more than a megabyte": ("#" * 2_000_000, "larger than"),
}  # fmt: skip


@pytest.mark.variants(1)
@pytest.mark.parametrize("name", JOBS)
def test_hostile_jobs_are_refused(name: str, tmp_path: Path) -> None:
    from typer.testing import CliRunner

    from damageest.cli import app

    seeds.write_others(tmp_path)
    (tmp_path / "loop.stl").symlink_to("loop.stl")
    os.mkfifo(tmp_path / "pipe.stl")
    text, words = JOBS[name]
    job = tmp_path / "deep/er/job.yaml"
    job.parent.mkdir(parents=True)
    head = {"version": "1", "tolerance": "0.5", "part": "../../box.stl", "scan": "../../points.npy", "align": "none"}
    head.pop(text.split(":")[0], None)
    text = text.replace("loop.stl", "../../loop.stl").replace("pipe.stl", "../../pipe.stl")
    job.write_text("".join(f"{key}: {value}\n" for key, value in head.items()) + text + "\n")
    before = sorted(path.name for path in tmp_path.rglob("*") if path not in job.parents)
    done = CliRunner().invoke(app, ["run", str(job), "--quiet"])
    assert done.exit_code == 2, (done.output, done.exception)
    assert words in done.stderr
    stages = job.parent / "out/job/stages"  # what was computed before is kept
    after = {path for path in tmp_path.rglob("*") if not path.is_relative_to(stages)} - set(stages.parents)
    assert sorted(path.name for path in after) == before, "nothing else is written"


@pytest.mark.parametrize("name", ["pipe", "/dev/zero", "loop"])
def test_what_is_no_file_is_no_job(name: str, tmp_path: Path) -> None:
    from typer.testing import CliRunner

    from damageest.cli import app

    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "loop").symlink_to("loop")
    done = CliRunner().invoke(app, ["validate", str(tmp_path / name)])
    assert done.exit_code == 2
    assert not done.exception or isinstance(done.exception, SystemExit)


@pytest.mark.slow
def test_merged_mappings_and_dates_are_read(tmp_path: Path) -> None:
    from damageest.job import yamlfile

    text = "a: &a {b: 1}\nc:\n  <<: *a\n  d: 2\nname: 2020-01-31\n"
    assert yamlfile.parse(text, "job")[0] == {"a": {"b": 1}, "c": {"b": 1, "d": 2}, "name": "2020-01-31"}
