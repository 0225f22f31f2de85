"""The Campaign screen."""
