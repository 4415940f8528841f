"""The page: a bar on top, the steps at the left, one panel for each step, the 3D view."""

from damageest_app.panels.layout import build

__all__ = ["build"]
