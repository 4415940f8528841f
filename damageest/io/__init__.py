"""Readers and writers of mesh and point formats, and conversions to objects of other libraries."""
