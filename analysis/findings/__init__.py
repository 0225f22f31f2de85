"""What is told of a fit: quantities with uncertainties, events, the verdict, warnings, curves."""
