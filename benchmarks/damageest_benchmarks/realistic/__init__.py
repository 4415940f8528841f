"""Scans as real sensors make them, of parts with and without a known loss."""
