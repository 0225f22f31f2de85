"""Fit of a law of motion: initial guess, chi-square with its derivatives, and search for the minimum."""
