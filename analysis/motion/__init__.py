"""Exact and published solutions of the motion."""
