"""Repaired parts with known faults, as `damageest inspect` judges them."""
