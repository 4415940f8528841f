"""Prepare: what of the scan is used, and which deviation counts as damage."""

from __future__ import annotations

from typing import Any

import numpy as np
from trame.widgets import html
from trame.widgets import vuetify3 as v3

from damageest.artefacts import Floats
from damageest_app import edits
from damageest_app.panels.cut import CutTool
from damageest_app.panels.marks import mark
from damageest_app.panels.shown import put_scan
from damageest_app.session import Panel, Session
from damageest_app.view.histogram import Histogram
from damageest_app.view.pick import Ray
from damageest_app.view.scene import Scene, make_lines, thin

AXES = "xyz"


class PreparePanel(Panel):
    """Crops of the scan, and the tolerance with the histogram of distances."""

    def __init__(self, session: Session) -> None:
        super().__init__(session)
        self.histogram: Histogram | None = None
        self.cut = CutTool(session)
        self.state.update(
            {"crops": [], "box": [[0.0, 1.0]] * 3, "extent": [[0.0, 1.0]] * 3, "box_step": 0.01, "tolerance": 0.0,
             "tolerance_auto": True, "tolerance_limits": [0.0, 1.0], "histogram": "", "intact_share": "",
             "show_box": False}
        )  # fmt: skip
        self.state.change("tolerance")(lambda **_: self._draw_histogram())
        self.state.change("box", "show_box")(lambda **_: self._draw_box())

    def build(self) -> None:
        html.Div("The scan", classes="head")
        html.Div("{{ scan_facts }}", classes="text-body-2", raw_attrs=mark("scan-facts"))
        html.Div("Crop", classes="head")
        with html.Div(classes="d-flex flex-wrap", style="gap: 8px"):
            v3.VBtn(
                "largest piece",
                size="small",
                variant="tonal",
                click=(self.crop, "['piece']"),
                disabled=("!has_inputs",),
                raw_attrs=mark("crop-piece"),
            )
            v3.VBtn(
                "box …",
                size="small",
                variant="tonal",
                click="show_box = !show_box",
                disabled=("!has_inputs",),
                raw_attrs=mark("box"),
            )
            v3.VBtn(
                "plane …",
                size="small",
                variant="tonal",
                click=self.cut.begin,
                disabled=("!has_inputs",),
                raw_attrs=mark("cut"),
            )
        self.cut.build()
        with html.Div(v_if=("show_box",), classes="mt-2"):
            for k, axis in enumerate(AXES):
                v3.VRangeSlider(
                    model_value=(f"box[{k}]",), min=(f"extent[{k}][0]",), max=(f"extent[{k}][1]",), step=("box_step",),
                    update_modelValue=f"box[{k}] = $event; flushState('box')", label=axis, hide_details=True,
                )  # fmt: skip
            with html.Div(classes="d-flex flex-wrap mt-1", style="gap: 8px"):
                v3.VBtn(
                    "keep the box",
                    size="small",
                    color="primary",
                    variant="tonal",
                    click=(self.crop, "['keep']"),
                    raw_attrs=mark("crop-keep"),
                )
                v3.VBtn("drop the box", size="small", variant="tonal", click=(self.crop, "['drop']"))
                v3.VBtn("remove below the box", size="small", variant="tonal", click=(self.crop, "['above']"))
        with html.Div(v_for=("(one, k) in crops",), key=("k",), classes="fine"):
            html.Span("{{ k + 1 }}. {{ one }}")
        v3.VBtn("undo the last crop", v_if=("crops.length",), size="small", variant="text", click=self.uncrop)
        html.Div("Tolerance", classes="head")
        html.Div(
            "Points nearer to the part than this are intact; {{ tolerance_auto ? 'auto, from the noise of the scan' : 'as the job says' }}.",
            classes="fine",
        )
        with html.Div(v_if=("histogram",)):
            html.Div(v_html=("histogram",))
            v3.VSlider(
                v_model=("tolerance",), min=("tolerance_limits[0]",), max=("tolerance_limits[1]",),
                step=("(tolerance_limits[1] - tolerance_limits[0]) / 400",), hide_details=True, end=(self.set_tolerance, "[$event]"),
                raw_attrs=mark("tolerance"),
            )  # fmt: skip
            html.Div(
                "λ = {{ Number(tolerance).toPrecision(3) }} {{ unit }}; {{ intact_share }} of the points are nearer",
                raw_attrs=mark("share"),
            )
            v3.VBtn("auto", size="small", variant="text", click=self.set_auto)
        html.Div("The histogram needs a pose: run the job once.", v_if=("!histogram",), classes="fine")

    async def crop(self, kind: str) -> None:
        """Adds a crop to the job; the scan is shown without what it removes at once."""
        box = np.array(self.state.box, float)
        crops: dict[str, dict[str, Any]] = {
            "piece": {"keep": "largest piece"},
            "keep": {"keep": "box", "min": box[:, 0], "max": box[:, 1]},
            "drop": {"drop": "box", "min": box[:, 0], "max": box[:, 1]},
            "above": {"keep": "above", "point": [0.0, 0.0, box[2, 0]], "normal": [0.0, 0.0, 1.0]},
        }
        self.state.show_box = False
        await self.session.apply(lambda tree: edits.add_crop(tree, crops[kind]), reads=True)

    async def uncrop(self) -> None:
        await self.session.apply(lambda tree: edits.drop_last(tree, "scan", "crop"), reads=True)

    async def set_tolerance(self, value: float) -> None:
        await self.session.apply(lambda tree: edits.set_field(tree, "tolerance", float(f"{value:.3g}")))

    async def set_auto(self) -> None:
        await self.session.apply(lambda tree: edits.set_field(tree, "tolerance", "auto"))

    def read(self, values: dict[str, Any]) -> None:
        scan = values.get("scan")
        crops = scan.get("crop", []) if isinstance(scan, dict) else []
        self.state.crops = [_describe(crop) for crop in crops]
        given = values.get("tolerance", "auto")
        self.state.tolerance_auto = not isinstance(given, (int, float))
        if isinstance(given, (int, float)):
            self.state.tolerance = float(given)
        elif self.session.results is not None:
            self.state.tolerance = self.session.results.tolerance
        inputs = self.session.inputs
        if inputs is not None and len(inputs.scan.points):
            low, high = inputs.scan.points.min(axis=0), inputs.scan.points.max(axis=0)
            step = float(f"{float((high - low).max()) / 400:.1g}")
            extent = np.column_stack([np.floor(low / step) * step, np.ceil(high / step) * step])
            if extent.tolist() != self.state.extent:
                self.state.box_step, self.state.extent, self.state.box = step, extent.tolist(), extent.tolist()

    def result(self) -> None:
        """Distances of the scan to the part, in the pose of the last run."""
        results, self.histogram = self.session.results, None
        scan = results.output.scan if results is not None else None
        if results is not None and scan is not None and len(scan.points):
            distance = scan.distance[thin(len(scan.points))]
            self.histogram = Histogram(distance, float(results.content["scan"]["noise"]), results.tolerance)
            self.state.tolerance_limits = list(self.histogram.limits)
            self.state.tolerance = results.tolerance
        self._draw_histogram()

    def _draw_histogram(self) -> None:
        if self.histogram is None:
            self.state.histogram = ""
            return
        tolerance = float(self.state.tolerance)
        self.state.histogram = self.histogram.draw(tolerance, self.state.unit)
        self.state.intact_share = f"{self.histogram.share(tolerance):.1%}"

    def draw(self, scene: Scene) -> None:
        if self.session.inputs is None:
            self.state.hint = "open a job first"
            return
        inputs = self.session.inputs
        put_scan(scene, inputs, np.zeros(3), self.cut.find_removed(inputs.scan.points[inputs.shown]))
        self._put_box(scene)

    def pick(self, ray: Ray) -> None:
        self.cut.pick(ray)

    def forget(self) -> None:
        self.cut.forget()

    def _draw_box(self) -> None:
        if self.state.step == "prepare":
            self._put_box(self.session.scene)
            self.session.push()

    def _put_box(self, scene: Scene) -> None:
        scene.remove("box")
        if self.state.show_box:
            box = np.array(self.state.box, float)
            scene.put("box", make_lines(outline_box(box[:, 0], box[:, 1])), colour="#e0218a", size=2.0)


def outline_box(low: Floats, high: Floats) -> list[Floats]:
    """The twelve edges of a box as lines."""
    ends = np.array([low, high])
    lines = []
    for axis in range(3):
        for first in (0, 1):
            for second in (0, 1):
                corner = np.empty((2, 3))
                corner[:, axis] = ends[:, axis]
                corner[:, (axis + 1) % 3] = ends[first, (axis + 1) % 3]
                corner[:, (axis + 2) % 3] = ends[second, (axis + 2) % 3]
                lines.append(corner)
    return lines


def _describe(crop: dict[str, Any]) -> str:
    verb = "keep" if "keep" in crop else "drop"
    rest = ", ".join(f"{key} {value}" for key, value in crop.items() if key not in ("keep", "drop"))
    return f"{verb} {crop[verb]}" + (f": {rest}" if rest else "")
