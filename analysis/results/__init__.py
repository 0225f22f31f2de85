"""What is candidates of a fit: quantities with uncertainties, events, the verdict, warnings, curves."""
