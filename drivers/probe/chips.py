"""What the USB numbers of a port say of the chip or board behind it."""

FTDI = 0x0403

_MAKERS = {
    FTDI: "FTDI serial adapter",
    0x0683: "DATAQ instrument",
    0x067B: "Prolific serial adapter",
    0x10C4: "Silicon Labs serial adapter",
    0x16C0: "PJRC Teensy or another board",
    0x1A86: "WCH serial adapter",
    0x2341: "Arduino",
    0x2A03: "Arduino",
    0x239A: "Adafruit board",
    0x2E8A: "Raspberry Pi microcontroller",
    0x303A: "Espressif microcontroller",
    0x04D8: "Microchip USB serial",
    0x1B4F: "SparkFun board",
    0x0483: "STMicroelectronics virtual port",
}
_CHIPS = {
    (FTDI, 0x6001): "FTDI FT232R adapter",
    (FTDI, 0x6010): "FTDI FT2232 adapter, two ports",
    (FTDI, 0x6011): "FTDI FT4232 adapter, four ports",
    (FTDI, 0x6014): "FTDI FT232H adapter",
    (FTDI, 0x6015): "FTDI FT-X adapter",
    (0x067B, 0x2303): "Prolific PL2303 adapter",
    (0x10C4, 0xEA60): "Silicon Labs CP210x adapter",
    (0x10C4, 0xEA70): "Silicon Labs CP2105 adapter, two ports",
    (0x1A86, 0x7523): "WCH CH340 adapter, as on many Arduino clones",
    (0x1A86, 0x5523): "WCH CH341 adapter",
    (0x1A86, 0x55D4): "WCH CH9102 adapter",
    (0x16C0, 0x0483): "PJRC Teensy",
    (0x2341, 0x0043): "Arduino Uno",
    (0x2341, 0x0010): "Arduino Mega 2560",
    (0x2341, 0x8036): "Arduino Leonardo",
    (0x2E8A, 0x000A): "Raspberry Pi Pico",
    (0x04D8, 0x00DD): "Microchip MCP2221 adapter",
}
"""Of the USB ID Repository, https://usb-ids.gowdy.us (names put short)."""


def usb_chip_name(vendor_id: int | None, product_id: int | None) -> str:
    """Name of a known chip or board, else of its maker, else ""."""
    if vendor_id is None:
        return ""
    return _CHIPS.get((vendor_id, product_id or 0)) or _MAKERS.get(vendor_id, "")
