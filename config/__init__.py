"""What the stand is: typed settings, their checks, and the files that a lab edits."""
