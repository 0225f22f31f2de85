"""Identification while the motion still dies away, in a process of its own."""
