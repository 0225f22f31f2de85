"""Arrays in, numbers with uncertainties out: no files, threads, Qt or serial.

`identify` takes a `record` to an `identification`. `one_mass` does so for a table without plate. `live`
follows a test as it runs. `refit` fits again from a known start. Each layer imports those below it only:

results      quantities, slip and rest, choice of the law, warnings (`uncertainty`: propagation and budget)
fitting      least-squares problem, initial guess, search
preparation  valid readings, noise, release, free decay
laws         friction laws and the other parts of the stand's model
motion       simulation of both masses, and of one

`calibration` compares a gauge with a dial gauge, `gauge_health` judges one at rest, `campaign` compares runs.
"""
