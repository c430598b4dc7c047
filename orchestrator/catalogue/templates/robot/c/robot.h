/* A rigid robot with wheels that are fixed to it: its variables, and what it does. No FMI here. */
#ifndef ROBOT_H
#define ROBOT_H

#define N_WHEELS NUMBER_OF_WHEELS

/* Places of the variables in `value`: the value references of modelDescription.xml, in its order. */
enum {
    MASS, INERTIA, GRAVITY = INERTIA + 6, CENTER_OF_MASS, START_POSITION = CENTER_OF_MASS + 3,
    START_VELOCITY = START_POSITION + 3, START_ANGLES = START_VELOCITY + 3, MOUNT = START_ANGLES + 3,
    LOADS = MOUNT + 3 * N_WHEELS,                  /* thrust, torque, then force and moment of each wheel */
    N_LOADS = 4 + 6 * N_WHEELS, RATES = LOADS + N_LOADS, /* their slopes, in the same order */
    BODY = RATES + N_LOADS,                        /* position, velocity, angular velocity, roll, pitch, yaw, energies */
    WHEEL = BODY + 14,                             /* position, axle, velocity, angular velocity; means and rotations */
    OF_WHEEL = 24, N_VARIABLES = WHEEL + OF_WHEEL * N_WHEELS
};

/* State: centre of mass 0:3, attitude (quaternion w, x, y, z) 3:7, velocity 7:10, angular velocity 10:13, all inertial.
 * Everything is in this structure and nothing points anywhere: a copy of it is the complete state. */
typedef struct {
    double value[N_VARIABLES];
    double state[13];
    double inverse_inertia[9]; /* about the centre of mass, in B */
    double time;               /* s */
} Robot;

void robot_defaults(Robot *r);          /* start values of all variables */
int robot_start(Robot *r);              /* from parameters to state and outputs; 0 if no body can have them */
int robot_step(Robot *r, double H);     /* over a macro step; 0 and nothing changed if the motion is not finite */
int robot_is_output(unsigned vr);
int robot_is_parameter(unsigned vr);

#endif
