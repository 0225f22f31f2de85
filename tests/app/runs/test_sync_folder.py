"""Folder entries are synced, on file systems that support it."""

import errno
import os
import sys

import pytest

from config.durable_files import sync_folder

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="Windows syncs no folders")


def _failing(number):
    def fsync(_handle):
        raise OSError(number, os.strerror(number))

    return fsync


def test_a_share_that_cannot_sync_folders_is_no_fault(tmp_path, monkeypatch):
    monkeypatch.setattr(os, "fsync", _failing(errno.EINVAL))
    sync_folder(tmp_path)


def test_a_disk_that_fails_is_one(tmp_path, monkeypatch):
    monkeypatch.setattr(os, "fsync", _failing(errno.EIO))
    with pytest.raises(OSError, match=os.strerror(errno.EIO)):
        sync_folder(tmp_path)
