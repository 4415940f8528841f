"""Scans made after a step of a repair, compared with the target of the step; and the record of the repair."""

# The modules:
# aim.py: target of a step
# compare.py: a scan against it
# discrepancies.py: missing and excess metal, with its place
# places.py: the finished skin of a site, cut into places
# joined.py: bodies that touch a site
# verdicts.py: verdicts on sites and part
# record.py, page.py: record over the life of a repair, its page
