"""From a rough pose to one that fits: robust fits, and whether such a pose explains the scan."""
