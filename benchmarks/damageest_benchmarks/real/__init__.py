"""Real parts with their CAD, from a folder that the user names: each run is compared with a crude difference."""
