"""TOML files of devices: those in a driver's folder, and a user's own."""

import tomllib
from importlib.resources.abc import Traversable
from typing import Any

from drivers.errors import SettingsError
from messages.i18n import N_


def shipped_names(folder: Traversable) -> list[str]:
    """Names of the files in a driver's folder, without their suffix."""
    names = [entry.name for entry in folder.iterdir()]
    return sorted(name.removesuffix(".toml") for name in names if name.endswith(".toml"))


def load_toml(path: Traversable, where: str, guide: str) -> dict[str, Any]:
    """Content of a file. Raises SettingsError, which names it as `where`, and the document `guide`."""
    try:
        return tomllib.loads(path.read_text("utf-8"))
    except OSError as error:
        template = N_("{where} cannot be read ({fault}): check its path")
        raise SettingsError(template, where=where, fault=error.strerror) from None
    except (UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        template = N_("{where} is no TOML ({fault}): see {guide}")
        raise SettingsError(template, where=where, fault=error, guide=guide) from None
