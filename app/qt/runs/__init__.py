"""The Runs screen as Qt widgets."""
