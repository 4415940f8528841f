"""Sections of part and scan: where they are, their contours, and what is measured on blades and shafts."""
