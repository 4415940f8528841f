"""Many jobs at once, on Dask: each in a process of its own, each a row of a table."""
