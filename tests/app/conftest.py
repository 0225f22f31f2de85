"""Puts the fakes of this folder (`stage.py`) within reach of the tests below it."""
