"""A cut of the scan by a plane of any direction, which two clicks into the view draw."""

from __future__ import annotations

import numpy as np
from trame.widgets import html
from trame.widgets import vuetify3 as v3

from damageest.artefacts import Flags, Floats
from damageest_app import edits
from damageest_app.panels.marks import mark
from damageest_app.session import Panel, Session
from damageest_app.view.pick import Ray


class CutTool(Panel):
    """Part of the step Prepare. ``plane``: a point (3,) and the unit normal (3,) to the side that is removed."""

    def __init__(self, session: Session) -> None:
        super().__init__(session)
        self.first: Ray | None = None
        self.plane: tuple[Floats, Floats] | None = None
        self.state.update({"cut": ""})

    def build(self) -> None:
        with html.Div(v_if=("cut",), classes="mt-2"):
            html.Div(
                "{{ {first: 'Turn the scan so that the cut is a line, and click one end of it.', second: 'Click the other "
                "end.', ready: 'The coloured points are removed.'}[cut] }}",
                classes="fine text-primary",
                raw_attrs=mark("cut-words"),
            )
            with html.Div(classes="d-flex flex-wrap mt-1", style="gap: 8px"):
                v3.VBtn(
                    "remove it", v_if=("cut === 'ready'",), size="small", color="primary", variant="tonal",
                    click=self.take, raw_attrs=mark("cut-take"),
                )  # fmt: skip
                v3.VBtn(
                    "the other side", v_if=("cut === 'ready'",), size="small", variant="tonal", click=self.flip,
                    raw_attrs=mark("cut-flip"),
                )  # fmt: skip
                v3.VBtn("no cut", size="small", variant="text", click=self.leave, raw_attrs=mark("cut-leave"))

    def begin(self) -> None:
        """The button of the tool; a second time, it starts anew."""
        self.forget()
        self.state.cut = "first"
        self.session.redraw()

    def leave(self) -> None:
        self.forget()
        self.session.redraw()

    def forget(self) -> None:
        self.first, self.plane, self.state.cut = None, None, ""

    def flip(self) -> None:
        if self.plane is not None:
            self.plane = self.plane[0], -self.plane[1]
            self.session.redraw()

    async def take(self) -> None:
        """Writes the cut into the job."""
        if self.plane is None:
            return
        point, normal = self.plane
        self.forget()
        crop = {"drop": "above", "point": point, "normal": normal}
        await self.session.apply(lambda tree: edits.add_crop(tree, crop), reads=True)

    def pick(self, ray: Ray) -> None:
        inputs = self.session.inputs
        if inputs is None or not self.state.cut:
            return
        points = inputs.scan.points[inputs.shown]
        if self.state.cut != "second" or self.first is None:
            self.first, self.plane, self.state.cut = ray, None, "second"
        else:
            self.plane = span_plane(self.first, ray, points.mean(axis=0))
            if self.plane is None:
                return
            if self.find_removed(points).mean() > 0.5:
                self.plane = self.plane[0], -self.plane[1]
            self.first, self.state.cut = None, "ready"
        self.session.redraw()

    def find_removed(self, points: Floats) -> Flags:
        """Which of the points (N,3) the cut removes (N,)."""
        if self.plane is None:
            return np.zeros(len(points), bool)
        return np.asarray((points - self.plane[0]) @ self.plane[1] >= 0)


def span_plane(first: Ray, second: Ray, near: Floats) -> tuple[Floats, Floats] | None:
    """The plane of two rays from one eye: its point closest to ``near`` (3,), and its unit normal (3,); None where the
    rays are the same."""
    normal = np.cross(first.direction, second.direction)
    length = float(np.linalg.norm(normal))
    if length < 1e-4:
        return None
    normal /= length
    return near - ((near - first.origin) @ normal) * normal, normal
