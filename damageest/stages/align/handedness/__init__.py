"""Whether the scan is of the other hand, of another size, or has its normals turned inward."""

# mirror.py: whether a scan shows the mirror image of the part, as a left-hand part scanned for a right-hand one
# normals.py: whether the signs of a scan's normals can be believed, and what a pose says of them
# scale.py: whether a scan of another scale explains the part
