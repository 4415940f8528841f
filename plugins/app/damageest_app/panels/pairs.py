"""Pairs: the same places, clicked on scan and part, from which a pose is found."""

from __future__ import annotations

from typing import Any

import numpy as np
from trame.widgets import html
from trame.widgets import vuetify3 as v3

from damageest.artefacts import Floats, Mesh
from damageest.io.colours import PART
from damageest_app import edits
from damageest_app.panels.marks import mark
from damageest_app.panels.shown import place_beside, put_scan
from damageest_app.session import Panel, Session
from damageest_app.view.pick import Ray, find_point
from damageest_app.view.scene import Scene, make_mesh

COLOURS = ("#e0218a", "#00a3a3", "#7a3ff2", "#b58900", "#2f86d6", "#5a5a5a")


class PairsTool(Panel):
    """Part of the step Align. ``pairs``: those of the job, or those that are being clicked for it; ``half``: a place
    on the scan whose place on the part comes next."""

    def __init__(self, session: Session) -> None:
        super().__init__(session)
        self.pairs: list[tuple[Floats, Floats]] = []
        self.half: Floats | None = None
        self._read = repr([])
        self.state.update({"pairs": [], "half": False, "pairs_in_job": False})

    def build(self) -> None:
        html.Div(
            "Click a place on the scan, then the same place on the part; three times or more.", classes="fine mb-2"
        )
        html.Div(
            "{{ half ? 'now the same place on the part' : 'a place on the scan' }}",
            classes="text-primary",
            raw_attrs=mark("pair-next"),
        )
        html.Div("{{ one }}", v_for=("(one, k) in pairs",), key=("k",), classes="text-body-2", raw_attrs=mark("pair"))
        with html.Div(classes="d-flex mt-2", style="gap: 8px"):
            v3.VBtn(
                "align by pairs",
                size="small",
                color="primary",
                variant="tonal",
                click=self.take,
                disabled=("pairs.length < 3 || pairs_in_job",),
                raw_attrs=mark("take-pairs"),
            )
            v3.VBtn(
                "undo one pair",
                size="small",
                variant="text",
                click=self.drop,
                disabled=("!pairs.length && !half",),
                raw_attrs=mark("drop-pair"),
            )
        html.Div("The pairs are in the job; run it.", v_if=("pairs_in_job",), classes="fine mt-1")

    async def take(self) -> None:
        await self.session.apply(lambda tree: edits.set_pairs(tree, self.pairs))

    def drop(self) -> None:
        if self.half is not None:
            self.half = None
        elif self.pairs:
            self.pairs.pop()
        self._show()
        self.session.redraw()

    def forget(self) -> None:
        """Another job was opened."""
        self.pairs, self.half, self._read = [], None, repr([])

    def read(self, values: dict[str, Any]) -> None:
        there = _list_pairs(values)
        if repr(there) != self._read:  # else pairs that are being clicked would be lost by another change of the job
            self._read, self.pairs = repr(there), there or self.pairs
        self._show()

    def draw(self, scene: Scene) -> None:
        inputs = self.session.inputs
        if inputs is None:
            return
        offset = place_beside(inputs.part.bounds, inputs.scan.points)
        scene.put("part", make_mesh(inputs.part), colour=PART)
        put_scan(scene, inputs, offset)
        radius = 0.018 * inputs.part.diagonal
        for k, pair in enumerate([*self.pairs, *([(self.half, None)] if self.half is not None else [])]):
            colour = COLOURS[k % len(COLOURS)]
            scene.put(f"pair {k} scan", make_mesh(_make_ball(pair[0] + offset, radius)), colour=colour)
            if pair[1] is not None:
                scene.put(f"pair {k} part", make_mesh(_make_ball(pair[1], radius)), colour=colour)

    def pick(self, ray: Ray) -> None:
        inputs, tools = self.session.inputs, self.session.find_tools()
        if inputs is None or tools is None:
            return
        if self.half is None:
            offset = place_beside(inputs.part.bounds, inputs.scan.points)
            index = find_point(inputs.scan.points, ray.move(offset))
            if index is not None:
                self.half = inputs.scan.points[index]
        elif (hit := tools[0].find(ray)) is not None:
            self.pairs.append((self.half, hit[0]))
            self.half = None
        self._show()
        self.session.redraw()

    def _show(self) -> None:
        there = _list_pairs(self.session.job.values) if self.session.job else []
        self.state.half = self.half is not None
        self.state.pairs = [f"{k}: scan {_format(a)}, part {_format(b)}" for k, (a, b) in enumerate(self.pairs, 1)]
        self.state.pairs_in_job = bool(there) and len(there) == len(self.pairs) and np.allclose(there, self.pairs)


def _list_pairs(values: dict[str, Any]) -> list[tuple[Floats, Floats]]:
    """The pairs of a job."""
    align = values.get("align")
    pairs = align.get("pairs", []) if isinstance(align, dict) else []
    return [(np.array(a, float), np.array(b, float)) for a, b in pairs]


def _make_ball(centre: Floats, radius: float) -> Mesh:
    """A small ball that marks a place."""
    import trimesh

    ball = trimesh.creation.icosphere(2, radius)
    return Mesh(np.asarray(ball.vertices) + centre, np.asarray(ball.faces))


def _format(place: Floats) -> str:
    return "(" + ", ".join(f"{x:.4g}" for x in place) + ")"
