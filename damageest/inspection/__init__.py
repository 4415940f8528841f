"""Scans made after a step of a repair, compared with what the step was to give; and the record of the repair."""
