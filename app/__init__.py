"""Everything that runs: acquisition, run files, command line, reports, desktop."""
