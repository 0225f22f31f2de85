"""The Simulated stand screen."""
