"""The parts of the identification of one mass, see `analysis.one_mass.identify`."""
