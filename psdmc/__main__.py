"""python -m psdmc"""

from psdmc.cli import main

main()
