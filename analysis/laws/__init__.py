"""Friction laws, and the other parts of the stand's model: suspension, release and gauges."""
