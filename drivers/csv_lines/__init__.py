"""Lines of comma-separated values, as Arduinos and loggers send them."""
