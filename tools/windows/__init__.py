"""Slipstand on Windows' own Python under Wine: `python -m tools.windows`, called by `make windows`."""
