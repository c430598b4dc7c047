"""Where things stand in the flat arrays of the contact law; its kernels and whoever calls them go by these names.

All places are the first of three components unless said otherwise. Vectors are inertial.
"""

from __future__ import annotations

# --- parameters of the law, ``prm`` (18,); the first fifteen are parameters of the module, in this order
PARAMETERS = (
    "stiffness",
    "exponent",
    "damping",
    "friction_coefficient",
    "wheel_radius",
    "groove_angle",
    "groove_width",
    "cable_diameter",
    "reference_length",
    "max_contact_length",
    "tangential_stiffness",
    "tangential_damping",
    "damping_law",
    "damping_coefficient",
    "damping_depth",
)
(
    STIFFNESS,
    EXPONENT,
    DAMPING,
    FRICTION_COEFFICIENT,
    WHEEL_RADIUS,
    GROOVE_ANGLE,
    GROOVE_WIDTH,
    CABLE_DIAMETER,
    REFERENCE_LENGTH,
    MAX_LENGTH,
    TANGENTIAL_STIFFNESS,
    TANGENTIAL_DAMPING,
    DAMPING_LAW,  # HUNT_CROSSLEY or IMPACT of law.py
    DAMPING_COEFFICIENT,
    DAMPING_DEPTH,
    SINE,  # of half the groove angle
    COSINE,
    APEX,  # radius of the groove's apex, m
) = range(18)
PRM_SIZE = 18

# --- motion (24,): the cable's part 0:12, the wheel's 12:24
POINT = 0  # of the cable, at the contact's arc length, m
TANGENT = 3  # dr/ds
POINT_RATE = 6
TANGENT_RATE = 9
WHEEL = 12  # from here on: the wheel's part, as `wheel_motion` of the robot writes it
CENTRE = 12
AXLE = 15
CENTRE_RATE = 18
TURN_RATE = 21  # angular velocity of the wheel, rad/s
MOTION_SIZE = 24

# --- what the law says at one instant, ``out`` (34,)
CABLE_FORCE = 0  # on the cable, N
CABLE_MOMENT = 3  # on the cable about its point, N m
WHEEL_FORCE = 6
WHEEL_MOMENT = 9  # about the wheel's centre
WRENCHES = 12  # number of the entries above
NORMAL = 12  # one number, N: sum of the forces of both walls
FRICTION = 13  # two numbers, N: on the cable, along it and across
DEEPEST = 15  # one number, m: penetration; negative: the gap
SLIP_VELOCITY = 16  # two numbers, m/s: of the cable relative to the wheel, along and across
CONTACT_LENGTH = 18  # one number, m
STATUS = 19  # one number: OPEN, STICK, SLIP or LEFT of law.py
OFFSET = 20  # one number, m of arc length: the foot of the wheel, from the cable point
ELONGATION = 21  # two numbers, m: of the bristle, within the Coulomb limit
WALL_POWER = 23  # one number, W, dissipated
FRICTION_POWER = 24  # one number, W, dissipated
WALL_ENERGY = 25  # one number, J, elastic
BRISTLE_ENERGY = 26  # one number, J, elastic
RADIAL = 27  # one number, N: of both walls on the wheel, from the cable towards the axle
LATERAL = 28  # one number, N: of both walls on the wheel, along its axle
SCRATCH = 29  # from here on free for whoever calls the law
OUT_SIZE = 34

# --- inputs of the module (48,): the motion at the end of the macro step, then
MEANS = 24  # time means of point, tangent, centre and axle
ROTATION = 36  # of the wheel over the macro step, rad
ROTATION_MEAN = 39
CURVATURE = 42  # d²r/ds² of the cable at its point, 1/m
TURN_MEAN = 45  # time mean of the tangent's rate, 1/s
INPUT_SIZE = 48

# --- state of the module (45,)
LAST = 0  # motion at the last communication point, as it came in
BRISTLE = 24  # two numbers, m: elongation
ARC = 26  # one number, m: arc length of the contact point
SHIFT = 27  # one number, m: by how much it moved at the last communication point
STORED = 28  # one number, J: elastic energy of walls and bristle
DISSIPATED = 29
WORK_CABLE = 30
WORK_WHEEL = 31
SLIDES = 32  # 1 if the bristle slides at the last communication point
GONE = 33  # 1 once the cable has left the groove
LAST_STEP = 34  # one number, s: length of the last macro step
LAST_CURVATURE = 35  # of the cable at the last communication point, 1/m
NORMAL_MAX = 38  # one number, N: largest within the last macro step
DEEPEST_MAX = 39  # one number, m
SLIP_MAX = 40  # one number, m/s, while cable and wheel touch
IMPULSE = 41  # one number, N s: of the normal force over the last macro step
TOUCH_TIME = 42  # one number, s: of the first touch; NOT_YET before
SENT = 43  # what came in at the last communication point: of the three below
ARC_RATE = 44  # one number, m/s: of the contact point's arc length within the step that begins
STATE_SIZE = 45
NOT_YET = -1.0
MOTION, NOTHING, FAR = 0.0, 1.0, 2.0  # a motion; zeros; after zeros, one of a cable point far from the wheel

# --- outputs of the module (43,)
O_CABLE = 0  # force, moment, force rate, moment rate on the cable
O_WHEEL = 12
O_ARC, O_ARC_RATE, O_NORMAL, O_FRICTION, O_DEEPEST, O_SLIP, O_LENGTH, O_STATUS = range(24, 32)
O_DISSIPATED, O_STRAIN, O_WORK_CABLE, O_WORK_WHEEL = range(32, 36)
O_RADIAL, O_LATERAL = 36, 37
O_NORMAL_MAX, O_DEEPEST_MAX, O_SLIP_MAX, O_IMPULSE, O_TOUCH_TIME = range(38, 43)
OUTPUT_SIZE = 43
