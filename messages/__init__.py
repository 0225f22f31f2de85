"""Text for people: translation of what the window shows."""
