"""The Runs screen: the library as a table, a preview, edits with undo, and work on many runs at once."""
