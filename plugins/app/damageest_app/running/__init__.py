"""Runs of the open job, and what they wrote."""

# The modules:
# runner.py: the process of a run
# events.py: its progress, from there to the app
# runs.py: the run as the page shows it
# results.py: what runs have written
