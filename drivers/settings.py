"""A device's own settings, as text, checked against the driver's typed struct."""

from typing import TypeVar

import msgspec

from drivers.errors import SettingsError

_Settings = TypeVar("_Settings", bound=msgspec.Struct)


def parse_settings(kind: type[_Settings], given: dict[str, str], protocol: str) -> _Settings:
    """`given` as `kind`.

    Raises
    ------
    SettingsError
        If a key is unknown or a value cannot be read.
    """
    allowed = [field.name for field in msgspec.structs.fields(kind)]
    for key in given:
        if key not in allowed:
            said = f"allowed are {', '.join(allowed)}" if allowed else "it has none"
            raise SettingsError(f"setting {key!r} is not known to {protocol}: {said}")
    try:
        return msgspec.convert(given, kind, strict=False)
    except msgspec.ValidationError as error:
        raise SettingsError(f"settings of {protocol}: {error}") from error
