"""The steps that say how exactly each site is known and what it is worth, up to the result."""
