"""The Simulated stand screen: what is true of it, what goes wrong with it."""
