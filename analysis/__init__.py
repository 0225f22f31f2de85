"""Arrays in, numbers with uncertainties out: no files, threads, Qt or serial.

`identify` is the whole way from a `record` to an `identification`; `one_mass` that of a table without plate,
`live` the one that follows a test as it runs, `refit` the short one from a known start. They pass through

readings     what the gauges can have seen, their noise, hum and drift, and where the free decay lies
             (`segments`: release and last movement; `decay`: the stick tail)
fitting      laws of motion, start values, chi-square with its derivatives (`friction`: the search)
findings     quantities, events, verdict, warnings (`uncertainty`: the budget)
motion       the exact motions themselves
single_mass  the parts of `one_mass`
calibration  a gauge against a dial gauge; `gauge_health` and `gauge_verdict` judge one at rest
"""
