"""What Slipstand is installed from: `python -m tools.packages`, called by `make packages`."""
