"""Modbus transmitters, RTU or TCP: polled, their registers described by a map in TOML."""

from drivers.driver import DeviceDriver
from messages.i18n import N_

DRIVER = DeviceDriver(
    name="modbus",
    title=N_("Modbus transmitters, RTU and TCP (Laumas, Scaime eNod4, Flintec, others by their registers)"),
    rank=50,
    default_baud=115200,
    evidence=N_(
        "reads pymodbus 3.16 as server of RTU and TCP; minimalmodbus 2.1 (RTU) and pymodbus (RTU, TCP) read"
        " the simulated device"
    ),
    package=__name__,
    frames_title=N_("Modbus frames"),
    has_single_gauge_settings=True,
)
