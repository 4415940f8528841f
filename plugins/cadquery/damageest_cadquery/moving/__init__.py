"""CAD solids that follow a part that was adapted to its scan."""
