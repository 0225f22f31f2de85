"""Friction from the plate alone: slips, their parabolas, and the mean over the slid path."""
