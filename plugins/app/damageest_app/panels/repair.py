"""Repair: stock on faces, the deposit, its path over time, and the files for the machine."""

from __future__ import annotations

import shutil
import subprocess
from typing import Any

import numpy as np
from trame.widgets import html
from trame.widgets import vuetify3 as v3

from damageest.io.colours import DEPOSIT, PART
from damageest_app import edits
from damageest_app.panels.align import put_faces
from damageest_app.pathview import PathPlay, make_nozzle
from damageest_app.pick import Ray
from damageest_app.scene import Scene, make_lines, make_mesh
from damageest_app.session import Panel, Session

STOCK, KEEP_OUT = "#e0902f", "#c0392b"
FORMATS = ("stl", "3mf", "ply", "step")
PATHS = ("csv", "apt", "rs274")
NUMBERS = (
    ("width", "bead width"), ("height", "layer height"), ("feed", "feed a minute"), ("standoff", "standoff"),
    ("tip_radius", "nozzle tip radius"), ("body_radius", "nozzle body radius"), ("length", "nozzle length"),
)  # fmt: skip
OF_NOZZLE = ("tip_radius", "body_radius", "length", "cone_angle")


class RepairPanel(Panel):
    """Tools: stock (clicks on faces), path, export."""

    def __init__(self, session: Session) -> None:
        super().__init__(session)
        self.plays: dict[int, PathPlay] = {}
        self.state.update(
            {"repair_tool": "stock", "face_action": "stock", "face_stock": 0.5, "outer": 0.0, "has_allowance": False,
             "targets": [], "keep_out": [], "has_path": False, "path": {}, "path_share": 1.0, "path_layer": 0,
             "path_layers": 0, "path_words": "", "path_sites": [], "path_site": 0, "formats": ["stl"],
             "path_formats": list(PATHS), "deposits": [], "result_files": [], "can_show": bool(shutil.which("xdg-open"))}
        )  # fmt: skip
        self.state.change("path_share", "path_site")(lambda **_: self._play())
        self.state.change("repair_tool")(lambda **_: session.redraw() if self.state.step == "repair" else None)

    def build(self) -> None:
        with v3.VBtnToggle(v_model=("repair_tool",), mandatory=True, color="primary", classes="mb-3", divided=True):
            for value in ("stock", "path", "export"):
                v3.VBtn(value, value=value, size="small", raw_attrs=[f'data-test="repair-{value}"'])
        with html.Div(v_if=("repair_tool === 'stock'",)):
            self._build_stock()
        with html.Div(v_if=("repair_tool === 'path'",)):
            self._build_path()
        with html.Div(v_if=("repair_tool === 'export'",)):
            self._build_export()

    def _build_stock(self) -> None:
        html.Div("Stock that is milled off after deposition.", classes="fine mb-2")
        v3.VTextField(
            v_model=("outer",),
            type="number",
            step=0.1,
            min=0,
            label="stock on all skin",
            suffix=("unit",),
            change=self.set_outer,
            classes="mb-3",
            raw_attrs=['data-test="outer"'],
        )
        html.Div("A click on a face of the part:", classes="fine")
        with v3.VRadioGroup(v_model=("face_action",), inline=True, hide_details=True):
            v3.VRadio(label="its own stock", value="stock")
            v3.VRadio(label="no stock (keep out)", value="keep out")
        v3.VTextField(
            v_model=("face_stock",),
            v_if=("face_action === 'stock'",),
            type="number",
            step=0.1,
            min=0,
            label="stock on the face",
            suffix=("unit",),
            classes="mt-2",
            raw_attrs=['data-test="face-stock"'],
        )
        html.Div(
            "{{ one }}",
            v_for=("(one, k) in targets",),
            key=("'t' + k",),
            classes="text-body-2 mt-1",
            raw_attrs=['data-test="target-row"'],
        )
        html.Div("keep out: {{ one }}", v_for=("(one, k) in keep_out",), key=("'k' + k",), classes="text-body-2 mt-1")
        v3.VBtn("no allowance", v_if=("has_allowance",), size="small", variant="text", click=self.drop_allowance)
        html.Div("{{ one }}", v_for=("(one, k) in deposits",), key=("'d' + k",), classes="fine mt-2")

    def _build_path(self) -> None:
        html.Div("Passes layer by layer that build the deposit up.", classes="fine mb-2")
        with html.Div(v_if=("!has_path",)):
            v3.VBtn(
                "plan a path",
                size="small",
                color="primary",
                variant="tonal",
                click=self.add_path,
                disabled=("!job_name",),
                raw_attrs=['data-test="add-path"'],
            )
        with html.Div(v_if=("has_path",)):
            for name, label in NUMBERS:
                v3.VTextField(
                    model_value=(f"path.{name}",), type="number", label=label, classes="mb-2",
                    change=(self.set_path, f"['{name}', $event.target.value]"), raw_attrs=[f'data-test="path-{name}"'],
                )  # fmt: skip
            v3.VBtn("no path", size="small", variant="text", click=self.drop_path)
        with html.Div(v_if=("path_layers",), classes="mt-2"):
            v3.VSelect(
                v_model=("path_site",),
                items=("path_sites",),
                label="site",
                v_if=("path_sites.length > 1",),
                classes="mb-2",
            )
            v3.VSlider(
                v_model=("path_share",),
                min=0,
                max=1,
                step=0.002,
                label="time",
                hide_details=True,
                raw_attrs=['data-test="time"'],
            )
            v3.VSlider(
                model_value=("path_layer",), min=1, max=("path_layers",), step=1, label="layer", hide_details=True,
                update_modelValue=(self.go_to_layer, "[$event]"), raw_attrs=['data-test="layer"'],
            )  # fmt: skip
            html.Div("{{ path_words }}", classes="fine", raw_attrs=['data-test="path-words"'])

    def _build_export(self) -> None:
        html.Div("Solids", classes="head")
        v3.VSelect(
            v_model=("formats",),
            items=("all_formats", list(FORMATS)),
            multiple=True,
            chips=True,
            update_modelValue="formats = $event",
            blur=self.set_formats,
            label="formats",
            raw_attrs=['data-test="formats"'],
        )
        html.Div("Paths", classes="head")
        v3.VSelect(
            v_model=("path_formats",),
            items=("all_paths", list(PATHS)),
            multiple=True,
            chips=True,
            blur=self.set_formats,
            label="formats",
        )
        html.Div("Formats are written by the next run.", classes="fine mt-1 mb-3")
        with html.Div(v_if=("has_result",)):
            v3.VBtn(
                "download one zip",
                prepend_icon="mdi-download",
                color="primary",
                variant="tonal",
                href="/download",
                download=True,
                raw_attrs=['data-test="download"'],
            )
            v3.VBtn(
                "open the folder",
                prepend_icon="mdi-folder-open",
                variant="text",
                v_if=("can_show",),
                click=self.show_folder,
            )
            html.Div("{{ one }}", v_for=("(one, k) in result_files",), key=("k",), classes="fine")

    async def set_outer(self) -> None:
        value = _to_length(self.state.outer)
        if value is not None:
            await self.session.apply(lambda tree: edits.set_stock(tree, value))

    async def drop_allowance(self) -> None:
        if await self.session.apply(lambda tree: edits.set_field(tree, "allowance", None)):
            self.session.redraw()

    async def add_path(self) -> None:
        """Values that fit the tolerance and the depth of the damage; a person changes them."""
        results = self.session.results
        depth = max((site["max_depth"] for site in results.content["sites"]), default=3.0) if results else 3.0
        height = float(f"{max(depth / 3, 0.2):.1g}")
        values = {
            "use": "layers", "height": height, "width": 2 * height, "feed": 600,
            "nozzle": {"tip_radius": height, "cone_angle": 25, "length": 40 * height, "body_radius": 8 * height},
        }  # fmt: skip
        await self.session.apply(lambda tree: edits.set_field(tree, "path", values))

    async def drop_path(self) -> None:
        await self.session.apply(lambda tree: edits.set_field(tree, "path", None))

    async def set_path(self, name: str, text: Any) -> None:
        value = _to_length(text)
        if value is None or value == self.state.path.get(name):
            return

        def change(tree: Any) -> None:
            mapping = tree["path"]["nozzle"] if name in OF_NOZZLE else tree["path"]
            mapping[name] = edits.to_round(value)

        await self.session.apply(change)

    async def set_formats(self) -> None:
        """Writes the formats into the job, those that are not the default."""
        formats, paths = list(self.state.formats) or ["stl"], list(self.state.path_formats)

        def change(tree: Any) -> None:
            edits.set_option(tree, "export", "files", "format", formats if formats != ["stl"] else None)
            edits.set_option(tree, "export", "files", "paths", paths if paths != list(PATHS) else None)

        await self.session.apply(change)

    def show_folder(self) -> None:
        output = self.session.find_output()
        if output is not None:
            subprocess.Popen(["xdg-open", str(output)], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)

    def pick(self, ray: Ray) -> Any:
        return self._pick_face(ray) if self.state.repair_tool == "stock" else None

    async def _pick_face(self, ray: Ray) -> None:
        tools = self.session.find_tools()
        hit = tools[0].find(ray) if tools else None
        height = _to_length(self.state.face_stock)
        if tools is None or hit is None or height is None:
            return
        face = tools[1].select(hit[1])
        if self.state.face_action == "stock":
            changed = await self.session.apply(lambda tree: edits.set_face_stock(tree, face, height))
        else:
            changed = await self.session.apply(lambda tree: edits.toggle_keep_out(tree, face))
        if changed:
            self.session.redraw()

    def read(self, values: dict[str, Any]) -> None:
        allowance, path, export = (values.get(name) for name in ("allowance", "path", "export"))
        allowance = allowance if isinstance(allowance, dict) else {}
        tools = self.session.find_tools()
        words = tools[1].describe if tools else str
        self.state.has_allowance, self.state.outer = bool(allowance), allowance.get("outer", 0.0)
        targets = allowance.get("targets", [])
        self.state.targets = [f"{one['outer']:g} {self.state.unit} on {words(one)}" for one in targets]
        self.state.keep_out = [words(one) for one in allowance.get("keep_out", [])]
        self.state.has_path = isinstance(path, dict) and path.get("use") == "layers"
        path = path if isinstance(path, dict) and self.state.has_path else {}
        self.state.path = {**path, **(path.get("nozzle") or {})}
        export = export if isinstance(export, dict) else {}
        formats = export.get("format", ["stl"])
        self.state.formats = [formats] if isinstance(formats, str) else list(formats)
        self.state.path_formats = export.get("paths", list(PATHS))

    def result(self) -> None:
        results, self.plays = self.session.results, {}
        self.state.deposits = results.describe_deposits() if results else []
        self.state.result_files = results.list_files() if results else []
        for number, path in results.list_paths() if results else []:
            self.plays[number] = PathPlay.read(path)
        self.state.path_sites = list(self.plays)
        self.state.path_site = next(iter(self.plays), 0)
        play = self.plays.get(self.state.path_site)
        self.state.path_layers = int(play.layer.max()) if play is not None else 0
        self.state.path_share = 1.0

    def go_to_layer(self, layer: int) -> None:
        play = self.plays.get(int(self.state.path_site))
        if play is not None:
            self.state.path_share = play.share_of_layer(int(layer))

    def draw(self, scene: Scene) -> None:
        inputs, results, tools = self.session.inputs, self.session.results, self.session.find_tools()
        if inputs is None or tools is None:
            self.state.hint = "open a job first"
            return
        tool = self.state.repair_tool
        values = self.session.job.values if self.session.job else {}
        allowance = values.get("allowance")
        allowance = allowance if isinstance(allowance, dict) else {}
        body = results.read_solid("undamaged") if results and tool != "stock" else None
        if body is not None:
            scene.put("part", make_mesh(body), colour=PART)
        else:
            named = [(one, STOCK) for one in reversed(allowance.get("targets", []))]
            put_faces(scene, tools[1], [*named, *((one, KEEP_OUT) for one in allowance.get("keep_out", []))])
        if results is not None and tool != "path":
            for number in results.output.site_numbers:
                solid = results.read_solid("deposit", number)
                if solid is None and tool == "export":  # the part as designed would cover the damage
                    solid = results.read_solid("damage", number)
                scene.put(f"deposit {number}", make_mesh(solid), colour=DEPOSIT)
        if tool == "path":
            self._put_path(scene)

    def _play(self) -> None:
        if self.state.step == "repair" and self.state.repair_tool == "path":
            self._put_path(self.session.scene)
            self.session.push()

    def _put_path(self, scene: Scene) -> None:
        """The passes up to a time, coloured by layer, and the nozzle there."""
        scene.remove("passes", "nozzle")
        play = self.plays.get(int(self.state.path_site))
        if play is None:
            self.state.path_words = ""
            return
        from matplotlib import colormaps

        end = play.at(float(self.state.path_share))
        pieces, layers = play.list_passes(end)
        shades = (np.array(colormaps["viridis"](np.linspace(0.1, 1, int(play.layer.max()) + 1)))[:, :3] * 255).astype(
            np.uint8
        )
        colours = [np.repeat(shades[[layer]], len(piece), axis=0) for piece, layer in zip(pieces, layers, strict=True)]
        scene.put("passes", make_lines(pieces, colours), size=3.0)
        nozzle = make_nozzle(self.state.path, play.points[end], play.axes[end]) if self.state.has_path else None
        scene.put("nozzle", make_mesh(nozzle), colour="#c9a227", opacity=0.6)
        self.state.path_layer = int(play.layer[end])
        self.state.path_words = (
            f"{play.minutes[end]:.2f} of {play.minutes[-1]:.2f} min, layer {play.layer[end]} of {play.layer.max()}"
        )


def _to_length(text: Any) -> float | None:
    """What a person typed as a length; None where it is no number, or below 0."""
    try:
        value = float(text)
    except (TypeError, ValueError):
        return None
    return value if np.isfinite(value) and value >= 0 else None
