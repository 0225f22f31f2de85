"""The simulated stand: motion from analysis and wire from drivers, in a process of its own."""
