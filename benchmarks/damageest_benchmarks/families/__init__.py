"""Families of scans drawn at random: thin walls, hands, round parts, datums, tables. Rays tell what was seen."""
