"""Scans with known trouble: how often a result is right, wrong but said, or wrong and silent."""
