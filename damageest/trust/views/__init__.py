"""Whether the views of a scan agree, and by how much they lie apart."""

# view_split.py: views that the scan does not name
# view_fit.py, view_joint.py, view_overlap.py: agreement of views, their correction, what remains
# two_sheets.py: two surfaces over the same skin
