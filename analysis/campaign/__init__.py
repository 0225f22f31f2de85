"""From the results of many runs to the paper's table, its effects and what they are worth."""
