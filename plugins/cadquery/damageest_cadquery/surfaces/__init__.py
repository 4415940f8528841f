"""The open surfaces that cut a damage volume out of the part: planes, recognised faces, splines, triangles."""
