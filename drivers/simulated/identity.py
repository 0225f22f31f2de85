"""How simulated devices are told from real ones by what a reader knows of them."""

from pathlib import PurePath

from drivers.samples import DeviceIdentity

FIRMWARE = "simulated-1"
"""Version that the simulated device with the reference firmware reports."""
PORT_FOLDER_PREFIX = "slipstand-stand-"  # begins the name of the folder that holds a pseudo-terminal
STREAM_ID_PREFIX = "slipstand-"  # begins the identifier of an LSL stream
_STREAM_URL = f"lsl://{STREAM_ID_PREFIX}"
_BETWEEN_PORTS = " + "


def is_simulated_device(identity: DeviceIdentity, port: str) -> bool:
    """Tell whether firmware or port are those of a simulated device.

    `port` is `PortInfo.identity`. A device without firmware version at a TCP port looks like a real one.
    """
    first = port.partition(_BETWEEN_PORTS)[0]
    return (
        FIRMWARE in identity.firmware
        or first.startswith(_STREAM_URL)
        or PurePath(first).parent.name.startswith(PORT_FOLDER_PREFIX)
    )
