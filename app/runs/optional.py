"""Libraries that few need: they come with `pip install 'slipstand[exchange]'`."""

import importlib
from typing import Any

from app.runs.errors import ExtraMissingError


def import_optional(module: str, for_what: str) -> Any:
    """Import a library of the extra `exchange`. Raises ExtraMissingError."""
    try:
        return importlib.import_module(module)
    except ImportError:
        package = module.partition(".")[0]
        raise ExtraMissingError(
            "{for_what} needs {package}, which is not installed. Install it: pip install {package}",
            for_what=for_what,
            package=package,
        ) from None
