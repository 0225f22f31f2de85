"""Everything that runs: acquisition, run files, command line, reports, desktop."""

from app.numba_import import install

install()
