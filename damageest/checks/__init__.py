"""Can it be trusted: the quality of the scan, and what the scan says of each damage volume."""
