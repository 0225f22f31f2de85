"""The Gauges screen: calibrations in use, health, ports and devices, calibration against a dial gauge."""
