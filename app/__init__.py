"""Everything that runs: acquisition, run files, command line, reports, desktop."""

from app.optional_imports import install

install()
