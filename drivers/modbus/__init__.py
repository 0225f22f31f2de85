"""Modbus RTU transmitters: polled, their registers described by a map in TOML."""
