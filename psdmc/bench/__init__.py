"""Times psdmc's functions and other libraries' on standard robots.

The defaults of the options are here, where no import is needed: the help loads quickly.
"""

SEED = 20_260
ROUNDS = 10
"""Trials that count; with 1,024 blocks each, the 99.99th percentile is taken from more than 10,000 blocks."""
