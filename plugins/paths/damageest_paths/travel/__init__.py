"""The ways between passes, and their order."""

# exits.py: ways of the tool from a pass to where it is clear of everything, and back
# moves.py: puts passes in a sequence, with the moves between them
# network.py: ways of the tool between passes in tight places, as inside a bore
# order.py: the order of the passes of a layer, so that the ways between them are short
# shortcuts.py: cuts the corners of a way of the tool between passes
