"""The wire side of the simulated stand: motion in, bytes and faults out."""
