"""What the scan shows of the skin."""

# skin_cells.py, coverage.py: skin that the scan shows
# shared_skin.py: points that an earlier scan can be compared with
# facing.py: points that face another way
# ray_evidence.py: what rays passed through
# unseen_rim.py: loss that ends at the edge of the scan
