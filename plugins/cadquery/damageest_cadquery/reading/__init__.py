"""Reads CAD files: solids, names, colours, datums and tolerances, and the triangles of their faces."""
