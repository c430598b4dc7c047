"""A wheel on a level cable, and the contact law on it: what the tests of the contact share."""

from __future__ import annotations

import math

import numpy as np

from fmus.contact import places as at
from fmus.contact.law import contact_wrench, law_parameters
from fmus.contact.module import Contact

HALF = math.radians(50.0)
SIN, COS = math.sin(HALF), math.cos(HALF)
APEX = 0.075 - 0.04 / math.tan(HALF)
SEAT = APEX + 0.009 / SIN  # radial distance at which the cable just touches both walls


def parameters(**settings):
    values = Contact.table.defaults()
    Contact.table.assign(values, settings)
    return law_parameters(values, Contact.table)


def wheel_above(depth=0.0, lateral=0.0, velocity=(0.0, 0.0, 0.0), slip_rate=(0.0, 0.0)):
    """A level cable along +Y under a wheel whose centre is `depth` (m) below first touch of the groove."""
    motion = np.zeros(at.MOTION_SIZE)
    motion[at.TANGENT + 1] = 1.0
    motion[at.CENTRE : at.AXLE] = -lateral, 0.0, SEAT - depth
    motion[at.AXLE] = 1.0
    motion[at.CENTRE_RATE : at.TURN_RATE] = velocity
    motion[at.POINT_RATE + 1], motion[at.POINT_RATE] = slip_rate
    return motion


def wrench(motion, slip=(0.0, 0.0), **settings):
    out = np.zeros(at.OUT_SIZE)
    assert contact_wrench(parameters(**settings), motion, np.array(slip, float), out) == 0
    return out
