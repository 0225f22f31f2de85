"""Files that another program has open, as Windows refuses them, and the sync of macOS."""

import datetime
import errno
import os
import sys
from pathlib import Path

import pytest

from config import durable_files
from config.durable_files import (
    FileInUseError,
    give_new_name,
    is_in_use,
    make_folders,
    remove_file,
    replace_file,
    sync_descriptor,
)
from config.files import load_settings, save_settings, settings_path
from config.schema import ConfigError, Settings

SHARING_VIOLATION, ACCESS_DENIED = 32, 5


def refusal(number: int) -> PermissionError:
    """Error that Windows raises, whose number this system does not have."""
    error = PermissionError(errno.EACCES, "Access is denied")
    error.winerror = number
    return error


class Holder:
    """A program that has a file open; it lets go after some tries."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, number: int, tries: float) -> None:
        self.tries = tries
        self._number = number
        for name in ("replace", "unlink"):
            monkeypatch.setattr(Path, name, self._guarded(getattr(Path, name)))
        monkeypatch.setattr(durable_files, "_PATIENCE_S", 0.2)

    def _guarded(self, change):
        def guarded(*arguments, **options):
            self.tries -= 1
            if self.tries >= 0:
                raise refusal(self._number)
            return change(*arguments, **options)

        return guarded


@pytest.fixture
def files(tmp_path):
    new, old = tmp_path / "new", tmp_path / "old"
    new.write_text("new")
    old.write_text("old")
    return new, old


@pytest.mark.parametrize("number", [SHARING_VIOLATION, ACCESS_DENIED])
def test_a_file_that_somebody_reads_is_replaced_when_it_is_let_go(files, monkeypatch, number):
    new, old = files
    Holder(monkeypatch, number, tries=2)
    replace_file(new, old)
    assert old.read_text() == "new"
    assert not new.exists()


def test_a_file_that_stays_open_is_left_and_named(files, monkeypatch):
    new, old = files
    Holder(monkeypatch, SHARING_VIOLATION, tries=float("inf"))
    with pytest.raises(FileInUseError) as raised:
        replace_file(new, old)
    assert str(raised.value) == f"{old} is open in another program. Close it there and try again"
    assert (new.read_text(), old.read_text()) == ("new", "old")
    with pytest.raises(FileInUseError, match="open in another program"):
        remove_file(old)


@pytest.mark.parametrize(("is_held", "raised"), [(True, FileInUseError), (False, PermissionError)])
def test_access_denied_is_said_of_open_files_and_of_missing_rights(files, monkeypatch, is_held, raised):
    monkeypatch.setattr(durable_files, "is_held_elsewhere", lambda *_, **__: is_held)
    Holder(monkeypatch, ACCESS_DENIED, tries=float("inf"))
    with pytest.raises(raised) as caught:
        replace_file(*files)
    assert type(caught.value) is raised


def test_missing_rights_of_other_systems_are_not_waited_for(files, monkeypatch):
    def refuse(*_):
        calls.append(1)
        raise PermissionError(errno.EACCES, "Permission denied")

    calls: list[int] = []
    monkeypatch.setattr(Path, "replace", refuse)
    with pytest.raises(PermissionError):
        replace_file(*files)
    assert len(calls) == 1


def test_errors_of_hdf5_tell_it_in_words():
    words = "Unable to synchronously open file (unable to open file: errno = 13, Win32 GetLastError() = {})"
    assert is_in_use(OSError(words.format(32)))
    assert is_in_use(OSError(words.format(33)))
    assert not is_in_use(OSError(words.format(2)))
    assert not is_in_use(OSError(words.format(320)))


def test_settings_that_are_open_elsewhere_are_told_so(tmp_path, monkeypatch):
    monkeypatch.setenv("SLIPSTAND_CONFIG", str(tmp_path))
    Holder(monkeypatch, SHARING_VIOLATION, tries=float("inf"))
    with pytest.raises(ConfigError, match=r"settings\.toml is open in another program"):
        save_settings(Settings(), datetime.date(2026, 1, 12))
    assert load_settings() == Settings()
    assert not settings_path().exists()


@pytest.mark.skipif(sys.platform == "win32", reason="replaces a function of POSIX")
def test_macos_is_asked_to_empty_the_memory_of_the_drive(tmp_path, monkeypatch):
    import fcntl

    asked = []
    monkeypatch.setattr(sys, "platform", "darwin")
    monkeypatch.setattr(fcntl, "F_FULLFSYNC", 51, raising=False)
    monkeypatch.setattr(fcntl, "fcntl", lambda *arguments: asked.append(arguments))
    with (tmp_path / "a").open("wb") as file:
        sync_descriptor(file.fileno())
        assert asked == [(file.fileno(), 51)]


@pytest.mark.skipif(sys.platform == "win32", reason="replaces a function of POSIX")
def test_a_share_that_cannot_do_that_is_synced_as_elsewhere(tmp_path, monkeypatch):
    import fcntl

    def refuse(*_):
        raise OSError(errno.ENOTSUP, "not supported")

    synced = []
    monkeypatch.setattr(sys, "platform", "darwin")
    monkeypatch.setattr(fcntl, "F_FULLFSYNC", 51, raising=False)
    monkeypatch.setattr(fcntl, "fcntl", refuse)
    monkeypatch.setattr(os, "fsync", synced.append)
    sync_descriptor(7)
    assert synced == [7]


@pytest.mark.parametrize("has_links", [True, False])
def test_a_new_name_overwrites_nothing_and_leaves_one_file(files, monkeypatch, has_links):
    """Also on a file system without links."""
    new, old = files
    if not has_links:

        def link(*_arguments, **_options):
            raise OSError(errno.EPERM, "no links here")

        monkeypatch.setattr(os, "link", link)
    with pytest.raises(FileExistsError):
        give_new_name(new, old)
    assert (new.read_text(), old.read_text()) == ("new", "old")
    give_new_name(new, other := old.with_name("other"))
    assert other.read_text() == "new"
    assert not new.exists()


@pytest.mark.skipif(sys.platform == "win32", reason="Windows syncs no folders")
def test_each_folder_that_is_made_is_synced_in_its_parent(tmp_path, monkeypatch):
    synced = []
    monkeypatch.setattr(durable_files, "sync_folder", synced.append)
    make_folders(tmp_path / "a" / "b")
    make_folders(tmp_path / "a" / "b")
    assert synced == [tmp_path, tmp_path / "a"]
