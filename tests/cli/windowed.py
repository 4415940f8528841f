"""`damageest view --window` on a virtual display: prints what each of its switches changes, in pixels."""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
import pyvista

from damageest.cli import app

show = pyvista.Plotter.show


def press_each_switch(plotter: Any, **_: Any) -> None:
    """Instead of the window's event loop."""
    show(plotter, interactive=False, auto_close=False)
    before = plotter.screenshot(return_img=True).astype(int)
    print("colours", int(np.ptp(before.reshape(-1, 3), axis=0).max()))
    for switch in plotter.widgets.button_widgets:
        look = switch.GetRepresentation()
        look.SetState(1 - look.GetState())
        switch.InvokeEvent("StateChangedEvent")
        plotter.render()
        after = plotter.screenshot(return_img=True).astype(int)
        print("changed", int((np.abs(after - before).sum(axis=2) > 30).sum()))
        before = after


pyvista.Plotter.show = press_each_switch
app(["view", sys.argv[1], "--window", "--site", "1"])
