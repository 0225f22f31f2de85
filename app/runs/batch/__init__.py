"""The same work on many runs: here, in processes of this computer, or on a cluster."""
