"""Shared by all tests: no window system is needed, and warnings are errors (pyproject.toml)."""

import os

os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")
os.environ.setdefault("MPLBACKEND", "Agg")
