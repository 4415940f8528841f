"""What all panels share: the open job, its inputs and results, the run, and what the page is told."""

from __future__ import annotations

import asyncio
import json
import traceback
from collections.abc import Callable, Coroutine
from contextlib import suppress
from pathlib import Path
from typing import Any, TypeVar

from damageest.errors import DamageestError, clean_message
from damageest.registry import Registry
from damageest_app.folder import Folder
from damageest_app.inputs import Inputs, Reader
from damageest_app.jobfile import ConflictError, Edit, JobFile
from damageest_app.running.results import Results
from damageest_app.running.runs import Runs
from damageest_app.view.faces import Faces
from damageest_app.view.pick import MeshPicker, Ray
from damageest_app.view.scene import Scene

T = TypeVar("T")
STEPS = ("open", "prepare", "align", "judge", "repair", "several")


class Panel:
    """One step of the page. ``read`` takes over the job into the state of the page, ``draw`` fills the 3D view."""

    def __init__(self, session: Session) -> None:
        self.session = session

    @property
    def state(self) -> Any:
        return self.session.state

    def read(self, values: dict[str, Any]) -> None:
        """The job was opened or changed."""

    def build(self) -> None:
        """Makes its part of the page."""

    def forget(self) -> None:
        """Another job is opened: what was clicked for the last one, and is not in it, goes."""

    def draw(self, scene: Scene) -> None:
        """The step is shown, or what it shows has changed."""

    def pick(self, ray: Ray) -> Any:
        """A click into the 3D view; may be a coroutine."""

    def look(self) -> None:
        """The folder may have other files."""

    def result(self) -> None:
        """There are other results."""

    def warm(self) -> None:
        """Prepares what a click will need, in a thread of its own."""


class Session:
    """One folder, in one or more tabs, which all show the same."""

    def __init__(self, server: Any, folder: Folder, registry: Registry) -> None:
        self.server, self.state, self.ctrl = server, server.state, server.controller
        self.folder, self.registry = folder, registry
        self.reader = Reader(registry)
        self.runs = Runs(self)
        self.scene = Scene()
        self.panels: dict[str, Panel] = {}
        self.job: JobFile | None = None
        self.inputs: Inputs | None = None
        self.results: Results | None = None
        self._tasks: set[asyncio.Future[None]] = set()
        self._tools: tuple[Any, MeshPicker, Faces] | None = None
        self.state.update(
            {
                "step": "open", "dark": False, "message": "", "tone": "info", "busy": "", "running": False,
                "share": 0.0, "doing": "", "stages": [], "seconds": 0, "job_name": "", "job_text": "",
                "can_undo": False, "can_redo": False, "show_job": False, "has_inputs": False, "has_result": False,
                "stale": False, "legend": [], "folder": str(folder.path), "writable": folder.is_writable,
                "summary": [], "notes": [], "conflict": False, "unit": "mm", "hint": "",
            }
        )  # fmt: skip

    # what the page is told

    def say(self, text: str, tone: str = "info") -> None:
        self.state.message, self.state.tone = clean_message(text, 3000), tone

    async def work(self, label: str, function: Callable[..., T], *arguments: Any) -> T | None:
        """Calls a function in a thread, so that the page stays alive; says what it raises. None where it raised."""
        with self.state:
            self.state.busy = label
        await asyncio.sleep(0)
        try:
            return await asyncio.to_thread(function, *arguments)
        except DamageestError as error:
            self.say(str(error), "error")
        except (OSError, MemoryError, ValueError) as error:
            self.say(f"{label}: {type(error).__name__}: {error}", "error")
        finally:
            with self.state:
                self.state.busy = ""
        return None

    def spawn(self, work: Coroutine[Any, Any, object]) -> None:
        """Goes on with this beside what the page asks for next: what a tab sends is answered in turn, so that nothing
        could be stopped or looked at while a handler waits for a run."""

        async def guard() -> None:
            try:
                await work
            except Exception as error:
                self.say(f"unexpected {type(error).__name__}: {error}", "error")
                traceback.print_exception(error)
            self.state.flush()

        task = asyncio.ensure_future(guard())
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    def redraw(self, frame: bool = False) -> None:
        """Fills the 3D view for the step that is shown; ``frame``: moves the camera to all of it."""
        self.scene.clear()
        self.state.legend, self.state.hint = [], ""
        if panel := self.panels.get(self.state.step):
            panel.draw(self.scene)
        self.push(self.scene.frame() if frame else None)

    def push(self, camera: dict[str, Any] | None = None) -> None:
        """Sends the 3D view to the browser."""
        if self.ctrl.view_update.exists():
            self.ctrl.view_update()
        if camera is not None:
            self.server.js_call("view", "setCamera", camera)

    def go(self, step: str, frame: bool = True) -> None:
        self.state.step = step
        self.redraw(frame)

    def find_tools(self) -> tuple[MeshPicker, Faces] | None:
        """What clicks on the part of the open job need; None where no part is open."""
        if self.inputs is None:
            return None
        part = self.inputs.part
        if self._tools is None or self._tools[0] is not part:
            self._tools = (part, MeshPicker(part), Faces(part))
        return self._tools[1:]

    # the job

    async def open_job(self, name: str) -> None:
        """Opens a job file of the folder, reads its inputs, and its results where it has some."""
        try:
            self.job = JobFile(self.folder.find(name))
            self.reader.check(self.job.path)
        except DamageestError as error:
            self.job = None
            self.say(str(error), "error")
            return
        self.results, self.state.has_result = None, False
        for panel in self.panels.values():
            panel.forget()
        self.state.message, self.state.conflict = "", False
        self.load_results()
        self.refresh()
        await self.read_inputs(frame=True)
        self.warm()

    async def read_inputs(self, frame: bool = False) -> None:
        """Reads part and scan as the job says now."""
        if self.job is None:
            return
        found = await self.work("reading part and scan", self.reader.read, self.job.values, self.job.path.parent)
        self.inputs = found
        self.state.has_inputs = found is not None
        self.refresh()
        self.redraw(frame)

    async def apply(self, edit: Edit, reads: bool = False) -> bool:
        """Makes a change to the job, and says why where it cannot be made. ``reads``: part or scan are other ones then.
        Gives whether the job is another one."""
        if self.job is None:
            return False
        path = self.job.path
        try:
            changed = self.job.edit(edit, self.reader.check)
        except ConflictError as error:
            self.state.conflict = True
            self.say(str(error), "warning")
            return False
        except (DamageestError, OSError) as error:
            self.say(str(error).replace(f".{path.name}.draft", path.name), "error")
            return False
        self.state.message = ""
        self.refresh()
        if changed and reads:
            await self.read_inputs()
        return changed

    async def step_back(self, forward: bool = False) -> None:
        """Undoes the last change, or makes it again."""
        if self.job is None:
            return
        try:
            moved = self.job.redo() if forward else self.job.undo()
        except (DamageestError, OSError) as error:
            self.state.conflict = isinstance(error, ConflictError)
            self.say(str(error), "warning")
            return
        if moved:
            self.refresh()
            await self.read_inputs()

    async def reload(self) -> None:
        """Takes the job as another program has left it."""
        if self.job is not None:
            try:
                self.job.reload()
            except DamageestError as error:
                self.say(str(error), "error")
                return
            self.state.conflict, self.state.message = False, ""
            self.refresh()
            await self.read_inputs()

    def refresh(self) -> None:
        """Brings the page up to date with the job."""
        state = self.state
        if self.job is None:
            return
        values = self.job.values
        state.job_name = self.job.path.relative_to(self.folder.path).as_posix()
        state.job_text, state.unit = self.job.text, str(values.get("units", "mm"))
        state.can_undo, state.can_redo = bool(self.job.done), bool(self.job.undone)
        state.stale = self._is_stale()
        for panel in self.panels.values():
            panel.read(values)

    def find_output(self) -> Path | None:
        """The output folder of the open job; None where it lies outside of the folder of the app."""
        if self.job is None:
            return None
        try:
            output = self.reader.check(self.job.path).output
            return self.folder.find(str(output))
        except DamageestError:
            return None

    def load_results(self) -> None:
        """Reads what the last run of the job has written, where it has."""
        output = self.find_output()
        self.results, self.state.summary, self.state.notes = None, [], []
        if output is not None and (output / "result.json").is_file():
            try:
                found = Results(output)
                found.list_sites({})
                self.state.summary, self.state.notes, self.results = found.summarise(), found.list_notes(), found
            except DamageestError as error:
                self.say(str(error), "warning")
            except (KeyError, TypeError, ValueError, IndexError) as error:
                why = f"{type(error).__name__}: {error}"
                self.say(f"the result in {output} is of another version ({why}); run the job again", "warning")
        self.state.has_result = self.results is not None
        for name, panel in self.panels.items():
            try:
                panel.result()
            except (DamageestError, OSError, ValueError, KeyError, TypeError, IndexError) as error:
                self.say(f"{name}: the result cannot be shown: {type(error).__name__}: {error}", "error")

    def warm(self) -> None:
        """Prepares what clicks will need, beside everything else."""
        if self.results is not None:
            asyncio.get_running_loop().run_in_executor(None, self._warm)

    def _warm(self) -> None:
        with suppress(DamageestError, OSError, ValueError):  # a click says what is wrong
            for panel in self.panels.values():
                panel.warm()

    def _is_stale(self) -> bool:
        """Whether the results are those of another job than the one that is open now."""
        output = self.find_output()
        if self.results is None or self.job is None or output is None:
            return False
        try:
            values = self.reader.check(self.job.path).to_values(output)
        except DamageestError:
            return True
        return bool(json.loads(json.dumps(values)) != (self.results.content.get("provenance") or {}).get("job"))

    def note_upload(self, name: str) -> None:
        with self.state:
            self.panels["open"].look()
            self.say(f"{name} is in the folder now", "success")
