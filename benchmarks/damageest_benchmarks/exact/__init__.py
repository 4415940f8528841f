"""Measures the exact form of damage volumes on parts of many kinds."""
