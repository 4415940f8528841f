"""Families of scans drawn at random: thin walls, mirrored parts, round parts. Ray casting tells what was seen."""
