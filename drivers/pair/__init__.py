"""Two one-channel devices on two ports, read as one device of two channels."""
