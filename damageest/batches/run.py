"""`damageest.batch`: many jobs at once, each a row."""

from __future__ import annotations

import contextlib
import errno
import uuid
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from damageest.batches.cluster import open_client, require_dask
from damageest.batches.files import Tables, read_rows
from damageest.batches.jobs import BatchJob, find_jobs
from damageest.batches.page import write_page
from damageest.batches.rows import Row, read_row
from damageest.batches.tasks import Ended, run_tasks
from damageest.batches.work import compute_key, load_job, release, work
from damageest.errors import DamageestError, Fault, JobError
from damageest.geometry.threads import count_cores
from damageest.io.files import check_output_folder, expand_home, working_folder
from damageest.isolation import measure_free_memory
from damageest.isolation.limits import STAGE_SECONDS
from damageest.pipeline.cache import describe_unwritable

TIMEOUT = 3600.0
"""Default time limit of a job, in seconds."""
UNWRITABLE = (
    errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS, errno.EACCES, errno.EPERM, errno.EIO, errno.ENOENT,
    errno.ENOTDIR, errno.EEXIST, errno.ENAMETOOLONG,
)  # fmt: skip
"""Errors of files, not of connections to a cluster."""
Tell = Callable[[Sequence[BatchJob], Mapping[str, Row], set[str]], None]
"""Called with all jobs, the rows that there are by name, and the names of those that run now."""


@dataclass(frozen=True)
class Options:
    """How the jobs of a batch run. ``memory``: bytes for each job, ``timeout``: seconds for each, 0 for no limit."""

    memory: int | None = None
    timeout: float = TIMEOUT
    stage_timeout: float = STAGE_SECONDS
    cache: bool = True


def batch(
    jobs: str | Path | Iterable[str | Path],
    *,
    client: Any = None,
    workers: int | None = None,
    scheduler: str = "",
    output: str | Path = "out/batch",
    settings: Sequence[str] = (),
    options: Options | None = None,
    tell: Tell | None = None,
) -> list[Row]:
    """Runs many jobs and gives a row for each, in the order of the jobs. No job ends the batch.

    ``jobs``: job files, folders, globs; a file with a ``matrix`` is a job for each combination of its values. Results
    go to ``output/<name>``, the table to ``output/batch.csv``, ``.json`` and ``.html``. ``client``: a
    ``distributed.Client``; without one, ``scheduler`` is the address of a cluster, and without that, ``workers`` local
    processes are started (default: as many as there are cores). A script that starts local ones needs
    ``if __name__ == "__main__":``. A cluster has to see the files under the same paths, and have damageest installed.

    Jobs with a result from an earlier call, of which neither the job nor a file nor the code has changed, do not run
    again. Raises JobError where there are no jobs, InputError where no scheduler answers.
    """
    require_dask()
    words = [jobs] if isinstance(jobs, (str, Path)) else list(jobs)
    working_folder()  # raises where it was deleted
    found, folder = find_jobs(words, settings), expand_home(Path(output)).absolute()
    if not found:
        raise JobError([Fault("give at least one job file, folder or glob")], "batch")
    check_output_folder(folder, "output")
    options = options or Options()
    rows = _find_done(found, folder) if options.cache else {}
    rows |= {job.name: _row(job, folder, outcome="refused", error=job.fault) for job in found if job.fault}
    waiting = [job for job in found if job.name not in rows]
    with _name_unwritable(folder), contextlib.ExitStack() as stack:
        stack.callback(lambda: write_page(_in_order(found, rows), folder))
        tables = stack.enter_context(contextlib.closing(Tables([job.name for job in found], rows.values(), folder)))
        if waiting and client is None:
            count = min(workers or count_cores(), len(waiting))
            if options.memory is None and not scheduler:
                options = replace(options, memory=measure_free_memory() // count)
            client = stack.enter_context(open_client(scheduler, count))
        if waiting:
            steps = stack.enter_context(contextlib.closing(_run(client, waiting, folder, options)))
            for new, active in steps:
                rows |= {row.name: row for row in new}
                tables.add(new)
                if tell:
                    tell(found, rows, active)
    return _in_order(found, rows)


@contextlib.contextmanager
def _name_unwritable(folder: Path) -> Iterator[None]:
    """Raises JobError where the tables cannot be written, as on a full disk."""
    try:
        yield
    except OSError as error:
        if error.errno not in UNWRITABLE:
            raise
        raise describe_unwritable(error, folder) from None


def _in_order(jobs: Sequence[BatchJob], rows: Mapping[str, Row]) -> list[Row]:
    return [rows[job.name] for job in jobs if job.name in rows]


def _row(job: BatchJob, folder: Path, **values: Any) -> Row:
    return Row(job.name, job.path, str(folder / job.name), settings=job.settings, **values)


def _run(
    client: Any, jobs: Sequence[BatchJob], folder: Path, options: Options
) -> Generator[tuple[list[Row], set[str]], None, None]:
    """Gives the rows of the jobs that have ended since, and the names of those that run. Where it is interrupted, what
    runs is ended."""
    token = f"damageest-{uuid.uuid4().hex[:8]}"
    shared = {"batch": token, **vars(options)}
    places = {job.name: job for job in jobs}
    tasks = {
        job.name: (
            shared
            | {"name": job.name, "job": job.path, "settings": list(job.settings), "output": str(folder / job.name)},
        )
        for job in jobs
    }

    def read(task: Ended) -> Row:
        lost = _row(places[task.name], folder, outcome="lost", error=task.why)
        return replace(lost if task.value is None else read_row(task.value), tries=task.tries)

    try:
        with contextlib.closing(run_tasks(client, work, tasks, token)) as steps:
            for ended, active in steps:
                yield [read(task) for task in ended], active
    finally:
        with contextlib.suppress(Exception):  # a cluster that has ended
            client.run(release, token)


def _find_done(jobs: Sequence[BatchJob], folder: Path) -> dict[str, Row]:
    """The rows of an earlier batch that stand: with a result that is there, of the same job, files and code."""
    stored = read_rows(folder)
    known = {
        name: row for name, row in stored.items() if row.has_result and (Path(row.output) / "result.json").is_file()
    }
    if not known:
        return {}
    from damageest.registry import Registry

    registry = Registry.discover()
    done: dict[str, Row] = {}
    for job in jobs:
        row = known.get(job.name)
        if row is None or job.fault or row.output != str(folder / job.name):
            continue
        with contextlib.suppress(DamageestError, OSError):  # it is a row again when it runs
            if compute_key(load_job(job.path, job.settings, registry), registry) == row.key:
                done[job.name] = replace(row, job=job.path, settings=job.settings)
    return done
