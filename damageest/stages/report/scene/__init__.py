"""The 3D view of the page."""

# scene.py: what it shows, as a snapshot for k3d's script
# scene_stage.py: collects its objects
# _path.py: a site's deposition path
# _least_depth.py: the least depth of a loss that the scan can show, by place
