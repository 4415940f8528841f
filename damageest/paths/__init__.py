"""Deposition paths: layers of a deposit, passes that fill them, the nozzle, its clearance, and the beads."""
