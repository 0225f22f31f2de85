"""Runs for other programs: one module a format, all of them on `Exported`, chosen in `formats`."""
