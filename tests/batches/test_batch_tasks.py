"""Tasks on a cluster: each has one end, whatever becomes of the cluster."""

from __future__ import annotations

import time
from typing import Any

from damageest.batches.tasks import run_tasks


def open_threads(count: int) -> Any:
    from distributed import Client

    return Client(processes=False, n_workers=1, threads_per_worker=count, dashboard_address=None)


def double(number: int) -> int:
    return 2 * number


def test_each_task_ends_once_and_few_are_at_dask() -> None:
    tasks = {str(number): (number,) for number in range(40)}
    with open_threads(2) as client:
        steps = list(run_tasks(client, double, tasks, "test"))
    ended = [task for some, _ in steps for task in some]
    assert {task.name: task.value for task in ended} == {str(number): 2 * number for number in range(40)}
    assert len(ended) == 40
    assert max(len(some) + len(active) for some, active in steps) <= 2


def test_tasks_that_a_cluster_left_are_lost_not_an_error() -> None:
    """Its jobs are rows, and the next call does them."""
    tasks = {str(number): (2.0,) for number in range(5)}
    with open_threads(1) as client:
        steps = run_tasks(client, time.sleep, tasks, "test")
        assert next(steps) == ([], {"0"})
        client.close()
        ended = [task for some, _ in steps for task in some]
    assert sorted(task.name for task in ended) == list(tasks)
    assert {(task.value, task.why) for task in ended} == {(None, "the cluster ended")}
