"""Writes STEP files, and reads each back before it counts."""
