"""The Gauges screen."""
