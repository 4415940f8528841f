"""OpenCASCADE solids: built of triangles, split, joined and measured."""
