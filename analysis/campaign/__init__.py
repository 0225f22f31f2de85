"""Summary of many runs: the paper's table, its effects and their uncertainties."""
