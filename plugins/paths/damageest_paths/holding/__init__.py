"""How the tool is held on a layer: what the machine reaches, axes that do not shake, walls that stand in the beam."""

# follow.py: the tool along passes on curved layers
# reach.py: the tool axes that a machine reaches
# shade.py: where a wall stands in the beam of an upright tool
# steady.py: tool axes along a pass that do not shake
# sweeps.py: the nozzle's distance along a path on which its axis turns
