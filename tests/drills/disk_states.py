"""The states of a disk that a power cut may leave, built from the calls that changed its files.

The contents of a file are kept in pages of 4096 bytes, or in sectors of 512 bytes where writes are torn. What
was written before the last sync began is there. Each page or sector that changed since has the contents of
any moment since, whatever the others have; so has the size. A name that was made, changed or removed since
its folder was synced last may be there or not, each by itself. A rename is done or not. This is more than a
journaling file system loses.
"""

import random
import re
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath

from tests.drills.system_calls import SystemCall

WAYS = ("least", "all", "pages", "sectors", "names")
"""Nothing that was not synced; all of it; a part of the pages, or of the sectors, and of the names; all
contents, but a part of the names."""

_PAGE_BYTES = {"sectors": 512}


@dataclass(frozen=True, slots=True)
class _Write:
    end_s: float
    offset: int
    data: bytes
    size: int | None = None
    """Size of the file that is set; None if it only grows by the data."""


@dataclass(slots=True)
class _File:
    writes: list[_Write] = field(default_factory=list)
    syncs: list[tuple[float, float]] = field(default_factory=list)
    """Begin and end (s)."""
    position: int = 0

    def synced(self, at_s: float) -> int:
        """Writes that are on disk for certain."""
        began_s = max((start_s for start_s, end_s in self.syncs if end_s <= at_s), default=-1.0)
        return sum(write.end_s <= began_s for write in self.writes)

    def done(self, at_s: float) -> int:
        return sum(write.end_s <= at_s for write in self.writes)

    def contents(self, count: int) -> bytes:
        """Contents after so many writes."""
        data = bytearray()
        for write in self.writes[:count]:
            _apply(data, write)
        return bytes(data)


@dataclass(frozen=True, slots=True)
class _Change:
    """Names of one call that changed together: removed where there is no node."""

    end_s: float
    names: tuple[tuple[int, str, int | None], ...]
    """Folder, name in it, and node."""


class Disk:
    """Files below one folder, which was empty when the log began."""

    def __init__(self, root: Path, calls: Iterable[SystemCall]) -> None:
        self.root = str(root)
        self.told: list[tuple[float, str]] = []
        """What a program wrote to a file named `told` beside the folder, and when."""
        self.files: dict[int, _File] = {}
        self._folder_syncs: dict[int, list[tuple[float, float]]] = {0: []}
        self._changes: list[_Change] = []
        self._live: dict[str, int] = {self.root: 0}
        self._ever: dict[str, int] = dict(self._live)
        self._told_path = str(root.with_name("told"))
        self._count = 0
        for call in calls:
            self._add(call)

    @property
    def moments(self) -> list[float]:
        """When something changed, was synced or was told (s), in order."""
        files = self.files.values()
        ends = {write.end_s for file in files for write in file.writes}
        ends |= {end_s for file in files for _, end_s in file.syncs}
        ends |= {end_s for syncs in self._folder_syncs.values() for _, end_s in syncs}
        return sorted(ends | {change.end_s for change in self._changes} | {end_s for end_s, _ in self.told})

    def told_by(self, at_s: float) -> list[str]:
        """What was told until then."""
        return [line for end_s, line in self.told if end_s <= at_s]

    def named(self, pattern: str) -> list[tuple[str, _File]]:
        """Files that ever had a path like this one, once for each."""
        found = {node: path for path, node in self._ever.items() if re.search(pattern, path)}
        return [(path, self.files[node]) for node, path in found.items() if node in self.files]

    def named_since_s(self, file: _File) -> float:
        """From when on some name of a file is on disk for certain; infinite for never."""
        (node,) = (number for number, other in self.files.items() if other is file)
        ends = [
            self._durable_from_s(folder, change.end_s)
            for change in self._changes
            for folder, _, made in change.names
            if made == node
        ]
        return min(ends, default=float("inf"))

    def make(self, into: Path, at_s: float, way: str, chance: random.Random) -> None:
        """Make one state of the disk after a cut at `at_s` in an empty folder."""
        entries: dict[int, dict[str, int]] = {}
        for change in self._changes:
            if change.end_s > at_s or not self._is_kept(change, at_s, way, chance):
                continue
            for folder, name, node in change.names:
                if node is None:
                    entries.get(folder, {}).pop(name, None)
                else:
                    entries.setdefault(folder, {})[name] = node
        self._make_folder(into, 0, entries, lambda file: _contents(file, at_s, way, chance))

    def check(self) -> None:
        """Compare the last state with what is there. Raises ValueError where they differ."""
        expected, found = self._expected(), dict[str, bytes | None]()
        for path in sorted(Path(self.root).rglob("*")):
            found[str(path)] = path.read_bytes() if path.is_file() else None
        for name in sorted(expected.keys() ^ found.keys()):
            raise ValueError(f"{name} is only in one of the log and the folder")
        for name, contents in found.items():
            if contents != expected[name]:
                raise ValueError(f"{name} has other contents than the log says")

    def _expected(self) -> dict[str, bytes | None]:
        nodes = {path: node for path, node in self._live.items() if node}
        files = self.files
        return {
            path: files[node].contents(len(files[node].writes)) if node in files else None
            for path, node in nodes.items()
        }

    def _make_folder(self, into: Path, node: int, entries, contents) -> None:  # type: ignore[no-untyped-def]
        for name, below in entries.get(node, {}).items():
            path = into / name
            if below in self.files:
                path.write_bytes(contents(self.files[below]))
            else:
                path.mkdir()
                self._make_folder(path, below, entries, contents)

    def _durable_from_s(self, folder: int, changed_s: float) -> float:
        syncs = self._folder_syncs.get(folder, [])
        return min((end_s for start_s, end_s in syncs if start_s >= changed_s), default=float("inf"))

    def _is_kept(self, change: _Change, at_s: float, way: str, chance: random.Random) -> bool:
        folder = next((folder for folder, _, node in change.names if node is not None), change.names[0][0])
        if self._durable_from_s(folder, change.end_s) <= at_s or way == "all":
            return True
        return way != "least" and chance.random() < 0.5

    def _add(self, call: SystemCall) -> None:
        if call.folder_or_file == self._told_path and call.name == "write":
            self.told += [(call.end_s, line) for line in call.texts[0].decode().splitlines()]
            return
        match call.name:
            case "openat" if "O_CREAT" in call.arguments or "O_TRUNC" in call.arguments:
                self._open(call)
            case "mkdir" | "mkdirat":
                self._make(call, self._path(call, 0), is_folder=True)
            case "rename" | "renameat" | "renameat2":
                self._rename(call, self._path(call, 0), self._path(call, 1))
            case "link" | "linkat":
                self._link(call, self._path(call, 0), self._path(call, 1))
            case "unlink" | "unlinkat" | "rmdir":
                self._unlink(call, self._path(call, 0))
            case "truncate":
                self._resize(self._live.get(self._path(call, 0)), call)
            case _:
                self._change_file(call)

    def _path(self, call: SystemCall, number: int) -> str:
        folders = re.findall(r"(?:AT_FDCWD|\d+)<(/[^>]*)>", call.arguments)
        text = call.texts[number].decode("utf-8", "surrogateescape")
        return str(PurePosixPath(folders[min(number, len(folders) - 1)] if folders else "/", text))

    def _is_inside(self, path: str) -> bool:
        return path.startswith(f"{self.root}/")

    def _open(self, call: SystemCall) -> None:
        path = self._path(call, 0)
        if not self._is_inside(path):
            return
        if path not in self._live:
            self._make(call, path, is_folder=False)
        file = self.files[self._live[path]]
        file.position = 0
        if "O_TRUNC" in call.arguments and file.writes:
            file.writes.append(_Write(call.end_s, 0, b"", 0))
        if "O_APPEND" in call.arguments:
            file.position = len(file.contents(len(file.writes)))

    def _make(self, call: SystemCall, path: str, *, is_folder: bool) -> None:
        if not self._is_inside(path) or path in self._live:
            return
        self._count += 1
        if is_folder:
            self._folder_syncs[self._count] = []
        else:
            self.files[self._count] = _File()
        self._change(call, [(path, self._count)])

    def _change(self, call: SystemCall, names: list[tuple[str, int | None]]) -> None:
        changed = []
        for path, node in names:
            place, _, name = path.rpartition("/")
            if not self._is_inside(path):
                continue
            changed.append((self._live[place], name, node))
            if node is None:
                self._live.pop(path, None)
            else:
                self._live[path] = self._ever[path] = node
        if changed:
            self._changes.append(_Change(call.end_s, tuple(changed)))

    def _rename(self, call: SystemCall, source: str, target: str) -> None:
        node = self._live.get(source)
        if node is None:
            return
        below = {path: inner for path, inner in self._live.items() if path.startswith(f"{source}/")}
        self._change(call, [(source, None), (target, node)])
        for path, inner in below.items():
            del self._live[path]
            moved = target + path.removeprefix(source)
            self._live[moved] = self._ever[moved] = inner

    def _link(self, call: SystemCall, source: str, target: str) -> None:
        if source in self._live:
            self._change(call, [(target, self._live[source])])

    def _unlink(self, call: SystemCall, path: str) -> None:
        if path in self._live:
            self._change(call, [(path, None)])

    def _change_file(self, call: SystemCall) -> None:
        path = call.folder_or_file.removesuffix(" (deleted)")
        if call.name in ("sendfile", "copy_file_range"):
            self._copy(call)
            return
        node = self._live.get(path, self._ever.get(path))
        if node is None:
            return
        file = self.files.get(node)
        if call.name in ("fsync", "fdatasync"):
            syncs = self._folder_syncs[node] if file is None else file.syncs
            syncs.append((call.start_s, call.end_s))
        elif file is not None and call.name == "lseek":
            file.position = call.result
        elif call.name in ("ftruncate", "fallocate"):
            self._resize(node, call)
        elif file is not None and call.name == "pwrite64":
            offset = int(call.arguments.rpartition(",")[2])
            file.writes.append(_Write(call.end_s, offset, call.texts[0][: call.result]))
        elif file is not None and call.name == "write":
            file.writes.append(_Write(call.end_s, file.position, call.texts[0][: call.result]))
            file.position += call.result
        elif file is not None and call.name in ("writev", "pwritev", "pwritev2"):
            raise NotImplementedError(f"{call.name} of {path}")

    def _resize(self, node: int | None, call: SystemCall) -> None:
        file = self.files.get(-1 if node is None else node)
        if file is None:
            return
        numbers = [int(text) for text in re.findall(r", (\d+)(?=,|$)", call.arguments)]
        size = numbers[-1]
        if call.name == "fallocate":
            size = max(numbers[-2] + numbers[-1], len(file.contents(len(file.writes))))
        file.writes.append(_Write(call.end_s, 0, b"", size))

    def _copy(self, call: SystemCall) -> None:
        """A copy within the system: what it copied stands in the other file."""
        paths = re.findall(r"\d+<(/[^>]*)>", call.arguments)
        if call.name == "copy_file_range":
            paths.reverse()
        target, source = (self._live.get(path) for path in paths[:2])
        if target is None or not call.result:
            return
        file = self.files[target]
        if source is None:
            whole = Path(paths[1]).read_bytes()  # of a file that nothing here changes
        else:
            whole = self.files[source].contents(len(self.files[source].writes))
        data = whole[file.position : file.position + call.result]
        file.writes.append(_Write(call.end_s, file.position, data))
        file.position += call.result


def _apply(data: bytearray, write: _Write) -> None:
    if write.size is not None:
        del data[write.size :]
        data.extend(bytes(write.size - len(data)))
    end = write.offset + len(write.data)
    if write.data:
        data.extend(bytes(max(0, end - len(data))))
        data[write.offset : end] = write.data


def _contents(file: _File, at_s: float, way: str, chance: random.Random) -> bytes:
    """Contents of a file after a cut: of each page one of those that it has had since the last sync."""
    synced, done = file.synced(at_s), file.done(at_s)
    if way == "least" or synced == done:
        return file.contents(synced)
    if way in ("all", "names"):
        return file.contents(done)
    page = _PAGE_BYTES.get(way, 4096)
    data = bytearray(file.contents(synced))
    later = file.writes[synced:done]
    size_after = chance.randrange(len(later) + 1)
    cuts: dict[int, int] = {}
    sizes = [len(data)]
    for number, write in enumerate(later):
        _write_pages(data, write, page, number, cuts, len(later), chance)
        sizes.append(_size(sizes[-1], write))
    size = sizes[size_after]
    del data[size:]
    data.extend(bytes(size - len(data)))
    return bytes(data)


def _size(before: int, write: _Write) -> int:
    if write.size is not None:
        return write.size
    return max(before, write.offset + len(write.data))


def _write_pages(
    data: bytearray,
    write: _Write,
    page: int,
    number: int,
    cuts: dict[int, int],
    count: int,
    chance: random.Random,
) -> None:
    """Apply those parts of a write whose page came to disk after it."""
    end = write.offset + len(write.data)
    for first in range(write.offset // page * page, end, page):
        cut = cuts.setdefault(first, chance.randrange(count + 1))
        if number >= cut:
            continue
        start, stop = max(first, write.offset), min(first + page, end)
        data.extend(bytes(max(0, stop - len(data))))
        data[start:stop] = write.data[start - write.offset : stop - write.offset]
