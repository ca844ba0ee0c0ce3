"""The names that a Python file with a friction law imports: the classes Law, Value and At, and elementary functions."""

from psdmc.friction.law import At as At
from psdmc.friction.law import Law as Law
from psdmc.friction.law import Number as Number
from psdmc.friction.law import Value as Value
from psdmc.friction.law import absolute as absolute
from psdmc.friction.law import cos as cos
from psdmc.friction.law import exp as exp
from psdmc.friction.law import larger as larger
from psdmc.friction.law import power as power
from psdmc.friction.law import select as select
from psdmc.friction.law import sin as sin
from psdmc.friction.law import smaller as smaller
from psdmc.friction.law import sqrt as sqrt
from psdmc.friction.law import tanh as tanh
