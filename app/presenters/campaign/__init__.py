"""The Campaign screen: what all runs say together."""
