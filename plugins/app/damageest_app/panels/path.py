"""The path of the deposit: its numbers in the job, and how it is laid over time."""

from __future__ import annotations

from typing import Any

import numpy as np
from trame.widgets import html
from trame.widgets import vuetify3 as v3

from damageest.io.colours import VIRIDIS
from damageest_app import edits
from damageest_app.panels.marks import mark
from damageest_app.session import Panel, Session
from damageest_app.view.colours import spread
from damageest_app.view.pathview import PathPlay, make_nozzle
from damageest_app.view.scene import Scene, make_lines, make_mesh

NUMBERS = (
    ("width", "bead width"), ("height", "layer height"), ("feed", "feed a minute"), ("standoff", "standoff"),
    ("tip_radius", "nozzle tip radius"), ("body_radius", "nozzle body radius"), ("length", "nozzle length"),
)  # fmt: skip
OF_NOZZLE = ("tip_radius", "body_radius", "length", "cone_angle")


class PathTool(Panel):
    """Part of the step Repair."""

    def __init__(self, session: Session) -> None:
        super().__init__(session)
        self.plays: dict[int, PathPlay] = {}
        self.state.update(
            {"has_path": False, "path": {}, "path_share": 1.0, "path_layer": 0, "path_layers": 0, "path_words": "",
             "path_sites": [], "path_site": 0, "path_faults": [], "path_left": ""}
        )  # fmt: skip
        self.state.change("path_share", "path_site")(lambda **_: self._play())
        self.state.change("path_layer")(lambda **_: self._go_to_layer())

    def build(self) -> None:
        html.Div("Passes of the deposit, layer by layer.", classes="fine mb-2")
        with html.Div(v_if=("!has_path",)):
            v3.VBtn(
                "plan a path",
                size="small",
                color="primary",
                variant="tonal",
                click=self.add_path,
                disabled=("!job_name",),
                raw_attrs=mark("add-path"),
            )
        with html.Div(v_if=("has_path",)):
            for name, label in NUMBERS:
                v3.VTextField(
                    model_value=(f"path.{name}",), type="number", label=label, classes="mb-2",
                    __events=["change"], change=(self.set_path, f"['{name}', $event.target.value]"), raw_attrs=mark(f"path-{name}"),
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
                raw_attrs=mark("time"),
            )
            v3.VSlider(
                v_model=("path_layer",), min=1, max=("path_layers",), step=1, label="layer", hide_details=True,
                raw_attrs=mark("layer"),
            )  # fmt: skip
            html.Div("{{ path_words }}", classes="fine", raw_attrs=mark("path-words"))
            html.Div(
                "{{ one.text }}",
                v_for=("(one, k) in path_faults",),
                key=("k",),
                classes=("one.is_much ? 'fine text-error font-weight-bold' : 'fine'",),
                raw_attrs=mark("path-fault"),
            )

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
        value = to_length(text)
        if value is None or value == self.state.path.get(name):
            return

        def change(tree: Any) -> None:
            mapping = tree["path"]["nozzle"] if name in OF_NOZZLE else tree["path"]
            mapping[name] = edits.to_round(value)

        await self.session.apply(change)

    def read(self, values: dict[str, Any]) -> None:
        path = values.get("path")
        self.state.has_path = isinstance(path, dict) and path.get("use") == "layers"
        path = path if isinstance(path, dict) and self.state.has_path else {}
        self.state.path = {**path, **(path.get("nozzle") or {})}

    def result(self) -> None:
        results, self.plays = self.session.results, {}
        for number, path in results.list_paths() if results else []:
            self.plays[number] = PathPlay.read(path)
        self.state.path_sites = list(self.plays)
        self.state.path_site = next(iter(self.plays), 0)
        play = self.plays.get(self.state.path_site)
        self.state.path_layers = int(play.layer.max()) if play is not None else 0
        self.state.path_share = 1.0
        self.state.path_faults = results.list_path_faults() if results else []
        much = [one["text"] for one in self.state.path_faults if one["is_much"]]
        self.state.path_left = "Do not run these paths on a machine: " + "; ".join(much) if much else ""

    def _go_to_layer(self) -> None:
        """The slider of layers was moved; where the one of the time moved it, both agree already."""
        play, layer = self.plays.get(int(self.state.path_site)), int(self.state.path_layer)
        if play is not None and layer and int(play.layer[play.at(float(self.state.path_share))]) != layer:
            self.state.path_share = play.share_of_layer(layer)

    def _play(self) -> None:
        if self.state.step == "repair" and self.state.repair_tool == "path":
            self.put(self.session.scene)
            self.session.push()

    def put(self, scene: Scene) -> None:
        """The passes up to a time, coloured by layer, and the nozzle there."""
        scene.remove("passes", "nozzle")
        play = self.plays.get(int(self.state.path_site))
        if play is None:
            self.state.path_words = ""
            return
        end = play.at(float(self.state.path_share))
        standoff = float(self.state.path.get("standoff") or self.state.path.get("width") or 0.0)  # as `path: layers`
        pieces, layers = play.list_passes(end)
        shades = spread(VIRIDIS, int(play.layer.max()) + 1)
        colours = [np.repeat(shades[[layer]], len(piece), axis=0) for piece, layer in zip(pieces, layers, strict=True)]
        scene.put("passes", make_lines(pieces, colours), size=3.0)
        tip = play.points[end] + standoff * play.axes[end]
        nozzle = make_nozzle(self.state.path, tip, play.axes[end]) if self.state.has_path else None
        scene.put("nozzle", make_mesh(nozzle), colour="#c9a227", opacity=0.6)
        self.state.path_layer = int(play.layer[end])
        self.state.path_words = (
            f"{play.minutes[end]:.2f} of {play.minutes[-1]:.2f} min, layer {play.layer[end]} of {play.layer.max()}"
        )


def to_length(text: Any) -> float | None:
    """What a person typed as a length; None where it is no number, or below 0."""
    try:
        value = float(text)
    except (TypeError, ValueError):
        return None
    return value if np.isfinite(value) and value >= 0 else None
