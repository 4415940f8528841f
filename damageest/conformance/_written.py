"""The checks for the stages that write files into a folder."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from damageest.conformance._base import StageContract, name_changes


class WritingContract(StageContract):
    """The checks for stages that write files. Each run has a folder of its own, in one folder for each check."""

    @pytest.fixture(autouse=True)
    def _set_folders(self, tmp_path: Path) -> None:
        self.home, self.count = tmp_path, 0

    def make_folder(self) -> None:
        """Makes the empty folder of the next run."""
        self.count += 1
        self.folder = self.home / f"run {self.count}"
        self.folder.mkdir()

    def call(self, stage: Any, given: dict[str, Any]) -> Any:
        self.make_folder()
        return super().call(stage, {**given, "folder": self.folder})

    def look_around(self) -> tuple[dict[str, bytes], list[str]]:
        """The files in the folder of the last run, by path, and the names of all else that runs have written."""
        written = {p.relative_to(self.folder).as_posix(): p.read_bytes() for p in self.folder.rglob("*") if p.is_file()}
        return written, [p.name for p in self.home.iterdir() if not p.name.startswith("run ")]

    def check_files(self, result: Any, written: dict[str, bytes], stray: list[str]) -> dict[str, bytes]:
        """Asserts that the result names the files that a run has written, each once. Gives their bytes, by path."""
        names = result.files
        assert len(set(names)) == len(names), "a file is named twice"
        assert not [name for name in names if Path(name).is_absolute() or ".." in Path(name).parts]
        assert written.keys() == set(names), "the named files differ from the files in the folder"
        assert not stray, "it wrote outside its folder"
        return {name: self.without_dates(data) for name, data in written.items()}

    def without_dates(self, data: bytes) -> bytes:
        """The bytes of a file without what each run writes anew."""
        return data

    def write_files(self, **changes: Any) -> dict[str, bytes]:
        """Runs the stage and gives the bytes of the files that it names, by path."""
        return self.check_files(self.run(**changes), *self.look_around())

    def _keep_files(self, key: str, run: Any) -> tuple[Any, Any]:
        """What ``run`` gives, and what it has written. It is called once for each ``key``."""
        if (key := f"{key} {self.stage!r}") not in self._results:
            result = run()
            self._results[key] = result, self.look_around()
        result_and_files: tuple[Any, Any] = self._results[key]
        return result_and_files

    def _run_and_watch(self) -> tuple[Any, list[str]]:
        watched: tuple[Any, list[str]] = self._keep_files("first", super()._run_and_watch)[0]
        return watched

    def run_again(self) -> Any:
        return self._keep_files("second", super().run_again)[0]

    def get_files(self) -> dict[str, bytes]:
        """The bytes of the files for the unchanged scene, by path. They are written once."""
        (result, _), written = self._keep_files("first", super()._run_and_watch)
        return self.check_files(result, *written)

    def test_fits_its_inputs(self) -> None:
        (result, _), (written, _) = self._keep_files("first", super()._run_and_watch)
        self.make_folder()  # that of the run is the folder of another check
        for name, data in written.items():
            (self.folder / name).parent.mkdir(parents=True, exist_ok=True)
            (self.folder / name).write_bytes(data)
        self.check_fits(result, self.make_inputs())

    def test_writes_the_files_it_names(self) -> None:
        self.get_files()

    def test_same_files_twice(self) -> None:
        again, written = self._keep_files("second", super().run_again)
        changed = name_changes(self.get_files(), self.check_files(again, *written))
        assert not changed, "the second run wrote other bytes into these files"
