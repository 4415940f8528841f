"""Align: how the scan lies on the part, other poses that fit as well, picked pairs, and the datum."""

from __future__ import annotations

from typing import Any

import numpy as np
from trame.widgets import html
from trame.widgets import vuetify3 as v3

from damageest.artefacts import Floats, Mesh
from damageest.io.colours import PART
from damageest_app import edits
from damageest_app.colours import colour_deviation, make_legend
from damageest_app.faces import Faces
from damageest_app.panels.open import SCAN, place_beside
from damageest_app.pick import Ray, find_point
from damageest_app.scene import Scene, make_mesh, make_points
from damageest_app.session import Panel, Session

PAIR = ("#e0218a", "#00a3a3", "#7a3ff2", "#b58900", "#2f86d6", "#5a5a5a")
DATUM = "#2fa84f"


class AlignPanel(Panel):
    """Deviation in colours; tools: look, pairs, datum."""

    def __init__(self, session: Session) -> None:
        super().__init__(session)
        self.pairs: list[tuple[Floats, Floats]] = []
        self.half: Floats | None = None
        self.state.update(
            {"align_tool": "look", "pose": 0, "poses": 1, "pose_words": [], "pairs": [], "datum": [], "align_use": "register",
             "half": False}
        )  # fmt: skip
        self.state.change("align_tool", "pose")(
            lambda **_: session.redraw(frame=self.state.align_tool == "pairs") if self.state.step == "align" else None
        )

    def build(self) -> None:
        with v3.VBtnToggle(v_model=("align_tool",), mandatory=True, color="primary", classes="mb-3", divided=True):
            for value, text in (("look", "deviation"), ("pairs", "pairs"), ("datum", "datum")):
                v3.VBtn(text, value=value, size="small", raw_attrs=[f'data-test="tool-{value}"'])
        with html.Div(v_if=("align_tool === 'look'",)):
            html.Div("Run the job to see how the scan lies on the part.", v_if=("!has_result",))
            html.Div("{{ one }}", v_for=("(one, k) in pose_words",), key=("k",), classes="text-body-2 mb-1")
            with html.Div(v_if=("poses > 1",), classes="mt-2"):
                html.Div("{{ poses }} poses fit. Step through them; take the right one.", classes="fine")
                with html.Div(classes="d-flex align-center"):
                    v3.VBtn(icon="mdi-chevron-left", variant="text", click="pose = (pose + poses - 1) % poses")
                    html.Div("pose {{ pose + 1 }} of {{ poses }}", raw_attrs=['data-test="pose"'])
                    v3.VBtn(
                        icon="mdi-chevron-right",
                        variant="text",
                        click="pose = (pose + 1) % poses",
                        raw_attrs=['data-test="next-pose"'],
                    )
                    v3.VBtn(
                        "take it",
                        size="small",
                        color="primary",
                        variant="tonal",
                        click=self.take_pose,
                        disabled=("pose === 0",),
                    )
        with html.Div(v_if=("align_tool === 'pairs'",)):
            html.Div(
                "Click a place on the scan, then the same place on the part; three times or more.", classes="fine mb-2"
            )
            html.Div(
                "{{ half ? 'now the same place on the part' : 'a place on the scan' }}",
                classes="text-primary",
                raw_attrs=['data-test="pair-next"'],
            )
            html.Div("{{ one }}", v_for=("(one, k) in pairs",), key=("k",), classes="text-body-2")
            with html.Div(classes="d-flex mt-2", style="gap: 8px"):
                v3.VBtn(
                    "align by pairs",
                    size="small",
                    color="primary",
                    variant="tonal",
                    click=self.take_pairs,
                    disabled=("pairs.length < 3",),
                    raw_attrs=['data-test="take-pairs"'],
                )
                v3.VBtn(
                    "take one back",
                    size="small",
                    variant="text",
                    click=self.drop_pair,
                    disabled=("!pairs.length && !half",),
                )
        with html.Div(v_if=("align_tool === 'datum'",)):
            html.Div(
                "Click faces of the part that are not worn. They fix the pose, as an inspector aligns on datums.",
                classes="fine mb-2",
            )
            html.Div(
                "{{ one }}",
                v_for=("(one, k) in datum",),
                key=("k",),
                classes="text-body-2",
                raw_attrs=['data-test="datum-row"'],
            )
            html.Div("no datum: all of the skin is used", v_if=("!datum.length",), classes="fine")
        html.Div("align: {{ align_use }}", classes="fine mt-4")
        v3.VBtn(
            "find the pose anew", v_if=("align_use !== 'register'",), size="small", variant="text", click=self.register
        )

    async def register(self) -> None:
        await self.session.apply(edits.set_register)

    async def take_pose(self) -> None:
        """Writes the pose that is shown into the job."""
        results = self.session.results
        if results is not None:
            pose = results.list_poses()[int(self.state.pose)]
            await self.session.apply(lambda tree: edits.set_pose(tree, pose))

    async def take_pairs(self) -> None:
        if await self.session.apply(lambda tree: edits.set_pairs(tree, self.pairs)):
            self.session.say("the pairs are in the job; run it", "success")

    def drop_pair(self) -> None:
        if self.half is not None:
            self.half = None
        elif self.pairs:
            self.pairs.pop()
        self._show_pairs()
        self.session.redraw()

    def read(self, values: dict[str, Any]) -> None:
        align = values.get("align", "register")
        options = align if isinstance(align, dict) else {}
        self.state.align_use = options.get("use", "register") if options else str(align)
        tools = self.session.find_tools()
        self.state.datum = [tools[1].describe(face) if tools else str(face) for face in options.get("datum", [])]
        self.pairs = [(np.array(a, float), np.array(b, float)) for a, b in options.get("pairs", [])] or self.pairs
        self._show_pairs()

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

    def draw(self, scene: Scene) -> None:
        inputs, results = self.session.inputs, self.session.results
        tool = self.state.align_tool
        if inputs is None:
            self.state.hint = "open a job first"
        elif tool == "pairs":
            self._draw_pairs(scene)
        elif tool == "datum":
            self._draw_datum(scene)
        elif results is None:
            scene.put("part", make_mesh(inputs.part), colour=PART)
        else:
            self._draw_deviation(scene)

    def _draw_deviation(self, scene: Scene) -> None:
        inputs, results = self.session.inputs, self.session.results
        assert inputs is not None
        assert results is not None
        scan = results.output.scan
        scene.put("part", make_mesh(inputs.part), colour=PART, opacity=0.25)
        if scan is None:
            return
        points, poses = scan.points, results.list_poses()
        colours = colour_deviation(scan.distance, results.tolerance)
        if 0 < int(self.state.pose) < len(poses):  # from the part's frame by the first pose back, by the other forth
            move = poses[int(self.state.pose)] @ np.linalg.inv(poses[0])
            points = points @ move[:3, :3].T + move[:3, 3]
            scene.put("scan", make_points(points), colour=SCAN)
            return
        scene.put("scan", make_points(points, colours), size=2.5)
        self.state.legend = make_legend(results.tolerance, results.unit)

    def _draw_pairs(self, scene: Scene) -> None:
        inputs = self.session.inputs
        assert inputs is not None
        offset = place_beside(inputs.part.bounds, inputs.scan.points)
        scene.put("part", make_mesh(inputs.part), colour=PART)
        scene.put("scan", make_points(inputs.scan.points + offset), colour=SCAN)
        radius = 0.012 * inputs.part.diagonal
        for k, pair in enumerate([*self.pairs, *([(self.half, None)] if self.half is not None else [])]):
            colour = PAIR[k % len(PAIR)]
            scene.put(f"pair {k} scan", make_mesh(make_ball(pair[0] + offset, radius)), colour=colour)
            if pair[1] is not None:
                scene.put(f"pair {k} part", make_mesh(make_ball(pair[1], radius)), colour=colour)

    def _draw_datum(self, scene: Scene) -> None:
        inputs, tools = self.session.inputs, self.session.find_tools()
        assert inputs is not None
        assert tools is not None
        align = self.session.job.values.get("align") if self.session.job else None
        faces = align.get("datum", []) if isinstance(align, dict) else []
        put_faces(scene, tools[1], [(face, DATUM) for face in faces])

    def pick(self, ray: Ray) -> Any:
        if self.state.align_tool == "datum":
            return self._pick_datum(ray)
        if self.state.align_tool == "pairs":
            self._pick_pair(ray)
        return None

    async def _pick_datum(self, ray: Ray) -> None:
        tools = self.session.find_tools()
        hit = tools[0].find(ray) if tools else None
        if tools is None or hit is None:
            return
        face = tools[1].select(hit[1])
        if await self.session.apply(lambda tree: edits.toggle_datum(tree, face)):
            self.session.redraw()

    def _pick_pair(self, ray: Ray) -> None:
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
        self._show_pairs()
        self.session.redraw()

    def _show_pairs(self) -> None:
        self.state.half = self.half is not None
        self.state.pairs = [f"{k}: scan {_format(a)}, part {_format(b)}" for k, (a, b) in enumerate(self.pairs, 1)]


def put_faces(scene: Scene, faces: Faces, named: list[tuple[Any, str]]) -> None:
    """Shows the part with some of its faces in colours; the last colour of a face holds."""
    part = faces.part
    colours = np.tile(np.array([154, 165, 173], np.uint8), (len(part.faces), 1))
    for face, colour in named:
        colours[faces.match(face)] = [int(colour[k : k + 2], 16) for k in (1, 3, 5)]
    scene.put("part", make_mesh(part, colours))


def make_ball(centre: Floats, radius: float) -> Mesh:
    """A small ball that marks a place."""
    import trimesh

    ball = trimesh.creation.icosphere(2, radius)
    return Mesh(np.asarray(ball.vertices) + centre, np.asarray(ball.faces))


def _format(place: Floats) -> str:
    return "(" + ", ".join(f"{x:.4g}" for x in place) + ")"
