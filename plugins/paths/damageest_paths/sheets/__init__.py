"""The surfaces of layers along the floor of a cavity, and their pieces unrolled into planes."""

# floor.py: the floor of a cavity, and the signed distance from it, which conformal layers follow
# patches.py: pieces of a sheet, unrolled into planes, and what is wanted of them as regions there
# sheets.py: the tops of conformal layers
# unroll.py: unrolls a curved surface into a plane, so that patterns can be drawn there and put back on the surface
