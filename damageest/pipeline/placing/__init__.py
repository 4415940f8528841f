"""The steps that read, place and correct the scan, up to the distance of each point."""
