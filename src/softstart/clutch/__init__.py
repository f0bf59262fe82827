"""A slipping clutch with constant driving speed, a shaft with or without a gap, and a load: [C].

>>> from softstart.clutch import Clutch, engage
>>> start = engage(Clutch.load("paper-c"))
>>> round(start.peak_torque / 9.80665, 2), round(start.slip_work / 9.80665)
(64.66, 27141)
"""

from __future__ import annotations

from softstart.clutch.engagement import Engagement, engage
from softstart.clutch.laws import LAWS, Law
from softstart.clutch.model import Clutch

__all__ = ["LAWS", "Clutch", "Engagement", "Law", "engage"]
