"""Bytes in, sample blocks out: one folder a device."""
