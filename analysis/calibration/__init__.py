"""Calibration of a gauge: counts against the readings of a dial gauge."""
