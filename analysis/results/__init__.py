"""What is derived from a fit: quantities with uncertainties, events, the verdict, warnings, curves."""
