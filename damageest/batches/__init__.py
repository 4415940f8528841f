"""Many jobs at once, on Dask: each in a process of its own, each a row of a table."""

# The modules:
# jobs.py: which jobs
# run.py, tasks.py, cluster.py: a batch, its tasks, Dask
# work.py: one job on a worker
# rows.py, files.py, page.py: rows, tables, the page
