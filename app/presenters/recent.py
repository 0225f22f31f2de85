"""What was used last: amplifier, runs and folders. Each change is saved at once."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from config.schema import ConfigError, RecentDevice, RecentUse

RUNS_MAX, FOLDERS_MAX = 6, 6


class RecentItems:
    """Recently used items; `save` stores them, and `report_error` takes its errors."""

    def __init__(
        self,
        recent: RecentUse | None = None,
        save: Callable[[RecentUse], object] = lambda _: None,
        report_error: Callable[[ConfigError], None] = lambda _: None,
    ) -> None:
        self._recent = recent or RecentUse()
        self._save = save
        self._report_error = report_error

    @property
    def device(self) -> RecentDevice | None:
        return self._recent.device

    @property
    def runs(self) -> tuple[str, ...]:
        return self._recent.runs

    @property
    def folders(self) -> tuple[str, ...]:
        return self._recent.folders

    def folders_with(self, folder: str) -> tuple[str, ...]:
        """Recent folders, and one that is always offered."""
        return tuple(dict.fromkeys((*self.folders, folder)))

    @property
    def export_folder(self) -> str:
        return self._recent.export_folder

    @property
    def import_folder(self) -> str:
        return self._recent.import_folder

    def set_device(self, device: RecentDevice) -> None:
        self._change(device=device)

    def add_run(self, path: str) -> None:
        self._change(runs=_with_first(path, self.runs, RUNS_MAX))

    def remove_runs(self, paths: Sequence[str]) -> None:
        """Remove runs that are not where they were."""
        self._change(runs=tuple(path for path in self.runs if path not in paths))

    def add_folder(self, folder: str) -> None:
        self._change(folders=_with_first(folder, self.folders, FOLDERS_MAX))

    def set_export_target(self, target: str) -> None:
        self._change(export_folder=str(Path(target).parent))

    def set_import_file(self, path: str) -> None:
        self._change(import_folder=str(Path(path).parent))

    def _change(self, **changes: Any) -> None:
        changed = self._recent.replace(**changes)
        if changed == self._recent:
            return
        self._recent = changed
        try:
            self._save(changed)
        except ConfigError as error:
            self._report_error(error)


def _with_first(item: str, items: tuple[str, ...], most: int) -> tuple[str, ...]:
    return (item, *(other for other in items if other != item))[:most]
