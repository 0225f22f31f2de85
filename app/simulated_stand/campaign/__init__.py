"""A whole campaign of known truth: the series of Table 1, each some times, as run files."""
