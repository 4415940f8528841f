"""Evaluation of deposition paths: deposits of several kinds, 3 and 5 axes, and an independent check of the nozzle."""
