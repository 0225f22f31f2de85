"""The start page: simulated stand, amplifier, or a recording."""
