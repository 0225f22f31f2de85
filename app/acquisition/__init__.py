"""The engine: reads a device, keeps every byte, finds the pullback, writes the run."""
