"""Runs the command line of psdmc as `python -m psdmc`."""

from psdmc.cli import main

main()
