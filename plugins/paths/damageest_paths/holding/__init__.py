"""How the tool is held on a layer: what the machine reaches, axes that do not shake, walls that stand in the beam."""
