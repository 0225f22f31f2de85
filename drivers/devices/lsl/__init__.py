"""Streams of the Lab Streaming Layer, by which any converter that a program reads can be recorded."""

from drivers.driver import DeviceDriver
from messages.i18n import N_

DRIVER = DeviceDriver(
    name="lsl",
    title=N_("LSL streams (NI, LabJack, MCC, Phidget and others by a feeder)"),
    rank=55,
    evidence=N_("reads an outlet of liblsl 1.18 (pylsl 1.18) in another process"),
    package=__name__,
    frames_title=N_("chunks of an LSL stream"),
)
