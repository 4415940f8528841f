"""Measures the stage `adapt` on deformed parts: damaged, whole, worn, seen in part."""
