"""The exact deposit of a site: its damage volume with stock on CAD faces, and the cavity that is opened for it."""

# _compare.py: compares the exact stock of a deposit with the mesh's
# _edges.py: edges between faces of a solid
# _join.py: joins the solids of stock
# _mitre.py: the mitre of stock over a sharp convex edge
# _own_skin.py: stock on the exact damage volume's own skin
# _walls.py: the sides of stock
# _wedge.py: stock on concave cylinders whose radius is less than the stock is high, as fillets
# deposit.py: finds the exact deposit of a site
# offset_faces.py: stock on CAD faces
# opened.py: the exact form of a cavity that was opened before deposition, and of the metal that is milled off for it
