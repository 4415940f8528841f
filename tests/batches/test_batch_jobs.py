"""Which jobs a batch has."""

from __future__ import annotations

from pathlib import Path

import pytest

from damageest.batches.jobs import find_jobs
from damageest.errors import JobError

PLAIN = "version: 1\npart: a.stl\nscan: b.ply\n"


def write(path: Path, text: str = PLAIN) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)
    return path


def test_files_folders_and_globs(tmp_path: Path) -> None:
    one, two = write(tmp_path / "a/one.yaml"), write(tmp_path / "a/two.yml")
    far = write(tmp_path / "b/c/far.yaml")
    write(tmp_path / "a/notes.txt")
    words = [tmp_path / "a", str(tmp_path / "**/*.yaml"), one]
    assert [job.path for job in find_jobs(words)] == [str(one), str(two), str(far)]
    assert [job.name for job in find_jobs([tmp_path / "a"])] == ["one", "two"]


def test_a_file_that_is_not_there_is_a_job_of_its_own(tmp_path: Path) -> None:
    (job,) = find_jobs([tmp_path / "gone.yaml"])
    assert "there is no such file" in job.fault


def test_a_folder_or_glob_without_jobs_is_refused(tmp_path: Path) -> None:
    with pytest.raises(JobError, match="the folder has no job file"):
        find_jobs([tmp_path])
    with pytest.raises(JobError, match="no file matches"):
        find_jobs([tmp_path / "*.yaml"])


def test_names_differ_and_stay_in_the_folder(tmp_path: Path) -> None:
    paths = [tmp_path / "a/Job.yaml", tmp_path / "b/job.yaml", tmp_path / "c/job.yaml", tmp_path / "d/ü x;'y.yaml"]
    for path in paths:
        write(path)
    assert [job.name for job in find_jobs(paths)] == ["Job", "job-2", "job-3", "ü_x_y"]


def test_a_matrix_is_a_job_for_each_combination(tmp_path: Path) -> None:
    for name in ("b.ply", "a.ply"):
        write(tmp_path / "scans" / name)
    text = "version: 1\npart: a.stl\nmatrix:\n  scan: scans/*.ply\n  cluster.neighbours: [5, 9]\n"
    jobs = find_jobs([write(tmp_path / "night.yaml", text)], ["tolerance=0.2"])
    assert [job.name for job in jobs] == ["night-a-5", "night-a-9", "night-b-5", "night-b-9"]
    assert jobs[1].settings == (
        'name="night-a-9"',
        'scan="scans/a.ply"',
        "cluster.neighbours=9",
        "tolerance=0.2",
    )


@pytest.mark.parametrize(
    ("matrix", "text"),
    [
        ("[1]", "matrix: give stage or stage.option with its values"),
        ("{}", "matrix: give stage or stage.option with its values"),
        ("{scan: one.ply}", "matrix.scan: no file matches"),
        ("{scan: 'no/*.ply'}", "matrix.scan: no file matches"),
        ("{tolerance: 3}", "matrix.tolerance: give a list of values"),
        ("{tolerance: []}", "matrix.tolerance: give a list of values"),
    ],
)
def test_a_faulty_matrix_is_the_jobs_fault(matrix: str, text: str, tmp_path: Path) -> None:
    (job,) = find_jobs([write(tmp_path / "job.yaml", f"version: 1\nmatrix: {matrix}\n")])
    assert text in job.fault


def test_values_with_one_stem_have_names_that_tell_them_apart(tmp_path: Path) -> None:
    text = "version: 1\nmatrix: {scan: [a/x.ply, b/x.ply, {use: simulate}]}\n"
    names = [job.name for job in find_jobs([write(tmp_path / "job.yaml", text)])]
    assert names == ["job-a-x.ply", "job-b-x.ply", "job-3"]
