"""Repair: stock on faces, the deposit, its path over time, and the files for the machine."""

from __future__ import annotations

import shutil
import subprocess
from typing import Any

from trame.widgets import html
from trame.widgets import vuetify3 as v3

from damageest.io.colours import DEPOSIT, PART
from damageest_app import edits
from damageest_app.panels.marks import mark
from damageest_app.panels.path import PathTool, to_length
from damageest_app.panels.shown import put_faces
from damageest_app.session import Panel, Session
from damageest_app.view.pick import Ray
from damageest_app.view.scene import Scene, lift, make_mesh

STOCK, KEEP_OUT = "#e0902f", "#c0392b"
FORMATS = ("stl", "3mf", "ply", "step")
PATHS = ("csv", "apt", "rs274")
SELECTED = [("update_menu", "update:menu")]


class RepairPanel(Panel):
    """Tools: stock (clicks on faces), path, export."""

    def __init__(self, session: Session) -> None:
        super().__init__(session)
        self.path = PathTool(session)
        self.state.update(
            {"repair_tool": "stock", "face_action": "stock", "face_stock": 0.5, "outer": 0.0, "has_allowance": False,
             "targets": [], "keep_out": [], "formats": ["stl"], "path_formats": list(PATHS), "deposits": [], "result_files": [], "can_show": bool(shutil.which("xdg-open"))}
        )  # fmt: skip
        self.state.change("repair_tool")(lambda **_: session.redraw() if self.state.step == "repair" else None)

    def build(self) -> None:
        with v3.VBtnToggle(v_model=("repair_tool",), mandatory=True, color="primary", classes="mb-3", divided=True):
            for value in ("stock", "path", "export"):
                v3.VBtn(value, value=value, size="small", raw_attrs=mark(f"repair-{value}"))
        with html.Div(v_if=("repair_tool === 'stock'",)):
            self._build_stock()
        with html.Div(v_if=("repair_tool === 'path'",)):
            self.path.build()
        with html.Div(v_if=("repair_tool === 'export'",)):
            self._build_export()

    def _build_stock(self) -> None:
        html.Div("Stock that is milled off after deposition.", classes="fine mb-2")
        v3.VTextField(
            model_value=("outer",),
            type="number",
            step=0.1,
            min=0,
            label="stock on all skin",
            suffix=("unit",),
            __events=["change"],
            change=(self.set_outer, "[$event.target.value]"),
            classes="mb-3",
            raw_attrs=mark("outer"),
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
            raw_attrs=mark("face-stock"),
        )
        html.Div(
            "{{ one }}",
            v_for=("(one, k) in targets",),
            key=("'t' + k",),
            classes="text-body-2 mt-1",
            raw_attrs=mark("target-row"),
        )
        html.Div(
            "keep out: {{ one }}",
            v_for=("(one, k) in keep_out",),
            key=("'k' + k",),
            classes="text-body-2 mt-1",
            raw_attrs=mark("keep-out-row"),
        )
        v3.VBtn("no allowance", v_if=("has_allowance",), size="small", variant="text", click=self.drop_allowance)
        html.Div("{{ one }}", v_for=("(one, k) in deposits",), key=("'d' + k",), classes="fine mt-2")

    def _build_export(self) -> None:
        html.Div("Solids", classes="head")
        v3.VSelect(
            v_model=("formats",),
            items=("all_formats", list(FORMATS)),
            multiple=True,
            chips=True,
            __events=SELECTED,
            update_menu=(self.set_formats, "[$event, formats, path_formats]"),
            label="formats",
            raw_attrs=mark("formats"),
        )
        html.Div("Paths", classes="head")
        v3.VSelect(
            v_model=("path_formats",),
            items=("all_paths", list(PATHS)),
            multiple=True,
            chips=True,
            __events=SELECTED,
            update_menu=(self.set_formats, "[$event, formats, path_formats]"),
            label="formats",
        )
        html.Div("Formats are written by the next run.", classes="fine mt-1 mb-3")
        with html.Div(v_if=("has_result",)):
            html.Div(
                "{{ path_left }}",
                v_if=("path_left",),
                classes="text-error font-weight-bold mb-2",
                raw_attrs=mark("path-left"),
            )
            v3.VBtn(
                "download one zip",
                prepend_icon="mdi-download",
                color="primary",
                variant="tonal",
                href="/download",
                raw_attrs=mark("download", "download"),  # without this attribute the app itself goes to the file
            )
            v3.VBtn(
                "open the folder",
                prepend_icon="mdi-folder-open",
                variant="text",
                v_if=("can_show",),
                click=self.show_folder,
            )
            html.Div("{{ one }}", v_for=("(one, k) in result_files",), key=("k",), classes="fine")

    async def set_outer(self, text: Any) -> None:
        value = to_length(text)
        if value is not None:
            await self.session.apply(lambda tree: edits.set_stock(tree, value))

    async def drop_allowance(self) -> None:
        if await self.session.apply(lambda tree: edits.set_field(tree, "allowance", None)):
            self.session.redraw()

    async def set_formats(self, is_open: bool, formats: list[str], paths: list[str]) -> None:
        """Writes the formats into the job when the list is closed, those that are not the default."""
        if is_open:
            return
        formats = formats or ["stl"]

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
        height = to_length(self.state.face_stock)
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
        allowance, export = values.get("allowance"), values.get("export")
        allowance = allowance if isinstance(allowance, dict) else {}
        tools = self.session.find_tools()
        words = tools[1].describe if tools else str
        self.state.has_allowance, self.state.outer = bool(allowance), allowance.get("outer", 0.0)
        targets = allowance.get("targets", [])
        self.state.targets = [f"{one['outer']:g} {self.state.unit} on {words(one)}" for one in targets]
        self.state.keep_out = [words(one) for one in allowance.get("keep_out", [])]
        self.path.read(values)
        export = export if isinstance(export, dict) else {}
        formats = export.get("format", ["stl"])
        self.state.formats = [formats] if isinstance(formats, str) else list(formats)
        self.state.path_formats = export.get("paths", list(PATHS))

    def result(self) -> None:
        results = self.session.results
        self.state.deposits = results.describe_deposits() if results else []
        self.state.result_files = results.tell_files() if results else []
        self.path.result()

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
        if results is not None and (tool == "export" or (tool == "stock" and allowance)):
            for number in results.output.site_numbers:
                solid = results.read_solid("deposit", number) or results.read_solid("damage", number)
                scene.put(f"deposit {number}", make_mesh(lift(solid, 1e-3 * inputs.part.diagonal)), colour=DEPOSIT)
        if tool == "path":
            self.path.put(scene)
