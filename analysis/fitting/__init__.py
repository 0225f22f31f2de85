"""How a law of motion is fitted: laws, start values, chi-square with its derivatives, and the way down."""
