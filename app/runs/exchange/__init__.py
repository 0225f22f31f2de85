"""Runs for other programs: one module a format, all of them on `ExportedRun`, chosen in `formats`."""
