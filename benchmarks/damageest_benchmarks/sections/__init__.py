"""Sections of shafts that are worn out of round, with known least-squares circles."""
