"""The names that a Python file with a friction law imports: the classes Law, Value and At, and elementary functions."""

from psdmc.friction.law import At as At
from psdmc.friction.law import Law as Law
from psdmc.friction.law import Number as Number
from psdmc.friction.law import Value as Value
from psdmc.friction.scalars import absolute as absolute
from psdmc.friction.scalars import cos as cos
from psdmc.friction.scalars import exp as exp
from psdmc.friction.scalars import larger as larger
from psdmc.friction.scalars import power as power
from psdmc.friction.scalars import select as select
from psdmc.friction.scalars import sin as sin
from psdmc.friction.scalars import smaller as smaller
from psdmc.friction.scalars import sqrt as sqrt
from psdmc.friction.scalars import tanh as tanh
