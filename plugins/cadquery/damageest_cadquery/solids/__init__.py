"""OpenCASCADE solids: built of triangles, split, joined and measured."""

# _folds.py: triangles that lie on others of their face, turned over
# doubles.py: pieces of a damage volume that lie in others of it, all or in part
# face_measures.py: kind and area of a face
# facets.py: joins the triangles of a solid to planar faces, so that a flat side of the part is one face again
# joining.py: solids of stock
# planar.py: builds OpenCASCADE solids with planar faces from meshes
# split.py: splits solids of the part by open surfaces, in OpenCASCADE: exact damage volumes
