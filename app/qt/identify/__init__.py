"""The Identify screen."""
