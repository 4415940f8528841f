"""Whether the scan is of the other hand, of another size, or has its normals turned inward."""
