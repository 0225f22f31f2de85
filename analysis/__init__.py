"""Arrays in, numbers with uncertainties out: no files, threads, Qt or serial."""
