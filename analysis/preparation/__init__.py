"""What a record's readings hold before any law of motion is fitted to them."""
