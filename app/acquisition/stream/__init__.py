"""Samples from the port: the connection, what becomes of it, and the readings that it gives."""
