"""Puts the helpers of this folder (`wire_helpers.py`) within reach of the tests below it."""
