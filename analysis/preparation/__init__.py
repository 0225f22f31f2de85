"""Analysis of a record's readings before any law of motion is fitted to them."""
