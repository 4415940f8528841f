"""The exact deposit of a site: its damage volume with stock on CAD faces, and the cavity that is opened for it."""
