"""The parts that a generated function is made of; the functions themselves are in psdmc/functions."""
