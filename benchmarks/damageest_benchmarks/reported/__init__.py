"""What users of other tools report in public, made anew as small scans with known truth, and what a run says of it."""
