"""Finding out which ports are there, what is plugged into them, and what stands in the way."""
