"""Fills a region of a plane with passes: regions, patterns, joints."""

# fill.py: patterns that fill a layer
# joints.py: joins lines whose ends are near into one pass, where that makes no reversal
# lines.py: the middle line of a pass, and what it is
# merging.py: merges rings that lie beside each other into one
# middles.py: lines in the middle of what is narrower than a bead
# regions.py: regions of a plane as manifold3d's CrossSection, which has the polygons and offsets of Clipper2
# rings.py: rings within a region, and the spiral that they become
# sharing.py: shares a region out between ways to hold the tool
# stripes.py: fills a region with parallel rows that cover all of it
# trim.py: cuts lines where the middle of a bead may not lie, and lengthens those that are shorter than a pass may be
# weave.py: fills a region with few long passes
