"""The steps from damaged points to the volume of each site."""
