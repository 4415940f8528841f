"""Options by their former names."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from damageest.errors import JobError
from damageest.job import load
from damageest.registry import Registry
from damageest.stages.enclose import EncloseAll

JOB = "enclose: {use: implicit, %s}\n"


def test_a_former_name_is_read_and_noted(job_file: Callable[..., Path], registry: Registry) -> None:
    job = load(job_file(JOB % "push: 2"), registry)
    assert job.stages[EncloseAll].offset == 2  # type: ignore[attr-defined]
    assert job.notes == ("enclose: the option push is called offset now; rename it in the job",)
    assert load(job_file(JOB % "offset: 2"), registry).notes == ()
    assert load(job_file(), registry, ["enclose.push=3"]).stages[EncloseAll].offset == 3  # type: ignore[attr-defined]


def test_faults_are_where_the_former_name_stands(job_file: Callable[..., Path], registry: Registry) -> None:
    with pytest.raises(JobError, match=r"job\.yaml:4:\d+: enclose\.offset: .*or equal to 4"):
        load(job_file(JOB % "push: 5"), registry)
    with pytest.raises(JobError, match=r"'push' is the former name of 'offset': give one of them"):
        load(job_file(JOB % "push: 1, offset: 2"), registry)


def test_each_former_name_has_an_option_now(registry: Registry) -> None:
    renamed = {item.cls: item.cls.renamed for item in registry.implementations if item.cls.renamed}
    assert len(renamed) >= 3
    for cls, names in renamed.items():
        assert set(names.values()) <= set(cls.model_fields)
        assert not set(names) & set(cls.model_fields)
