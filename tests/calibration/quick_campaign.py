"""A campaign short enough for a test."""

from psdmc.calibration.campaign import CampaignOptions
from psdmc.calibration.identify.steps import Load
from psdmc.calibration.motions.excite_options import ExciteOptions
from psdmc.calibration.motions.sweeps import SineOptions, SweepOptions

QUICK = CampaignOptions(
    sweep=SweepOptions(speed=0.15, seconds=16.0, range=0.8),
    sines=SineOptions(smallest=4e-5, largest=0.7, ratio=4.0, frequencies=(2.0, 6.0), cycles=1),
    excite=ExciteOptions(duration=6.0, samples=60, evaluations=300, random=50, seconds=20.0),
    load=Load(3.0, (0.1, 0.05, 0.0)),
    gravity_runs=1,
    repeats=2,
    table="npz",
)
