"""Align: how the scan lies on the part, other poses that fit as well, picked pairs, and the datum."""

from __future__ import annotations

from typing import Any

import numpy as np
from trame.widgets import html
from trame.widgets import vuetify3 as v3

from damageest.artefacts import Mesh
from damageest.io.colours import PART
from damageest_app import edits
from damageest_app.panels.datum import DatumTool
from damageest_app.panels.marks import mark
from damageest_app.panels.pairs import PairsTool
from damageest_app.panels.shown import SCAN
from damageest_app.session import Panel, Session
from damageest_app.view.colours import colour_deviation, make_legend
from damageest_app.view.pick import Ray
from damageest_app.view.scene import Scene, make_mesh, make_points
from damageest_app.view.shade import tint


class AlignPanel(Panel):
    """Deviation in colours; tools: look, pairs, datum."""

    def __init__(self, session: Session) -> None:
        super().__init__(session)
        self.tools: dict[str, Panel] = {"pairs": PairsTool(session), "datum": DatumTool(session)}
        self.state.update(
            {
                "align_tool": "look",
                "pose": 0,
                "poses": 1,
                "pose_words": [],
                "align_use": "register",
                "align_view": "skin",
            }
        )
        self.state.change("align_tool")(lambda **_: self._redraw(frame=True))
        self.state.change("pose", "align_view")(lambda **_: self._redraw())

    def _redraw(self, frame: bool = False) -> None:
        if self.state.step == "align":
            self.session.redraw(frame)

    def build(self) -> None:
        with v3.VBtnToggle(v_model=("align_tool",), mandatory=True, color="primary", classes="mb-3", divided=True):
            for value, text in (("look", "deviation"), ("pairs", "pairs"), ("datum", "datum")):
                v3.VBtn(text, value=value, size="small", raw_attrs=mark(f"tool-{value}"))
        with html.Div(v_if=("align_tool === 'look'",)):
            html.Div("Run the job to see how the scan lies on the part.", v_if=("!has_result",))
            with v3.VBtnToggle(
                v_model=("align_view",), v_if=("has_result",), mandatory=True, divided=True, classes="mb-2"
            ):
                v3.VBtn("on the skin", value="skin", size="x-small")
                v3.VBtn("scan points", value="points", size="x-small")
            html.Div("{{ one }}", v_for=("(one, k) in pose_words",), key=("k",), classes="text-body-2 mb-1")
            with html.Div(v_if=("poses > 1",), classes="mt-2"):
                html.Div("{{ poses }} poses fit. Step through them; take the right one.", classes="fine")
                with html.Div(classes="d-flex align-center"):
                    v3.VBtn(icon="mdi-chevron-left", variant="text", click="pose = (pose + poses - 1) % poses")
                    html.Div("pose {{ pose + 1 }} of {{ poses }}", raw_attrs=mark("pose"))
                    v3.VBtn(
                        icon="mdi-chevron-right",
                        variant="text",
                        click="pose = (pose + 1) % poses",
                        raw_attrs=mark("next-pose"),
                    )
                    v3.VBtn(
                        "take it",
                        size="small",
                        color="primary",
                        variant="tonal",
                        click=self.take_pose,
                        disabled=("pose === 0",),
                        raw_attrs=mark("take-pose"),
                    )
        for name, tool in self.tools.items():
            with html.Div(v_if=(f"align_tool === '{name}'",)):
                tool.build()
        html.Div("align: {{ align_use }}", classes="fine mt-4", raw_attrs=mark("align-use"))
        v3.VBtn(
            "search the pose again",
            v_if=("align_use !== 'register'",),
            size="small",
            variant="text",
            click=self.register,
        )

    async def register(self) -> None:
        await self.session.apply(edits.set_register)

    async def take_pose(self) -> None:
        """Writes the pose that is shown into the job."""
        results = self.session.results
        if results is not None:
            pose = results.list_poses()[int(self.state.pose)]
            await self.session.apply(lambda tree: edits.set_pose(tree, pose))

    def read(self, values: dict[str, Any]) -> None:
        align = values.get("align", "register")
        options = align if isinstance(align, dict) else {}
        self.state.align_use = options.get("use", "register") if options else str(align)
        for tool in self.tools.values():
            tool.read(values)

    def forget(self) -> None:
        for tool in self.tools.values():
            tool.forget()

    def result(self) -> None:
        results = self.session.results
        self.state.pose, self.state.poses, self.state.pose_words = 0, 1, []
        if results is None:
            return
        alignment = results.content["alignment"]
        self.state.poses = len(results.list_poses())
        words = [
            f"intact points lie within {alignment['rms']:.3g} {results.unit} (rms); {alignment['inliers']:.1%} of the scan"
        ]
        self.state.pose_words = [*words, *map(str, alignment["notes"]), *map(str, alignment["doubts"])]

    def warm(self) -> None:
        if self.session.results is not None:
            _ = self.session.results.skin
        self.session.find_tools()

    def draw(self, scene: Scene) -> None:
        inputs, results = self.session.inputs, self.session.results
        tool = self.state.align_tool
        if inputs is None:
            self.state.hint = "open a job first"
        elif tool in self.tools:
            self.tools[tool].draw(scene)
        elif results is None:
            scene.put("part", make_mesh(inputs.part), colour=PART)
        else:
            self._draw_deviation(scene)

    def _draw_deviation(self, scene: Scene) -> None:
        inputs, results = self.session.inputs, self.session.results
        assert inputs is not None
        assert results is not None
        poses, scan, skin = results.list_poses(), results.output.scan, results.skin
        if 0 < int(self.state.pose) < len(poses):
            scene.put("part", make_mesh(inputs.part), colour=PART)
            move = poses[int(self.state.pose)]
            points = inputs.scan.points[inputs.shown] @ move[:3, :3].T + move[:3, 3]
            scene.put("scan", make_points(points, tint(inputs.shade, SCAN)), size=2.5)
            return
        if self.state.align_view == "points" and scan is not None:
            scene.put("scan", make_points(scan.points, colour_deviation(scan.distance, results.tolerance)), size=2.5)
        elif skin is not None:
            seen = np.isfinite(skin[1])
            shown = Mesh(skin[0].vertices, skin[0].faces[seen])
            scene.put("skin", make_mesh(shown, colour_deviation(skin[1][seen], results.tolerance)))
            if scan is not None:  # what lies off the skin, where it lies
                off = np.abs(scan.distance) > results.tolerance
                scene.put(
                    "off",
                    make_points(scan.points[off], colour_deviation(scan.distance[off], results.tolerance)),
                    size=3.0,
                )
        self.state.legend = make_legend(results.tolerance, results.unit)

    def pick(self, ray: Ray) -> Any:
        tool = self.tools.get(self.state.align_tool)
        return tool.pick(ray) if tool else None
