"""The parts from which generated functions are made; the functions themselves are in psdmc/functions."""
