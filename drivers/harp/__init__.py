"""Harp LoadCells, an interface for eight load cells that sends at 1 kHz with the time of each sample."""
