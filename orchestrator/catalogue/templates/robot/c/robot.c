/* The rigid body: Newton and Euler, the classical Runge-Kutta method of order 4.
 *
 * Loads within a macro step [t, t + H] are load + rate (tau - t - H/2). Beside the state, four integrals a wheel are carried
 * along, of its position, axle, angular velocity, and of the angle turned: what means and rotations of the step are made of. */
#include "robot.h"

#include <math.h>
#include <string.h>

static const double LONGEST = 1e-3;                 /* s, longest inner step */
static const double AXLE[3] = {1.0, 0.0, 0.0};      /* of all wheels, in the body's frame B */
static const double MOUNTS[N_WHEELS][3] = {MOUNTS_C}; /* wheels' centres from b, in B, m */

/* state, then for each wheel the integrals */
enum { N_STATE = 13, N_ALL = N_STATE + 12 * N_WHEELS };

void robot_defaults(Robot *r) {
    memset(r, 0, sizeof *r);
    r->value[MASS] = 38.0;
    r->value[INERTIA] = r->value[INERTIA + 1] = 5.42; /* xx, yy, zz, xy, xz, yz */
    r->value[INERTIA + 2] = 8.5;
    r->value[GRAVITY] = 9.8;
    r->value[CENTER_OF_MASS + 2] = -0.1;
    memcpy(r->value + MOUNT, MOUNTS, sizeof MOUNTS);
}

int robot_is_output(unsigned vr) { return vr >= BODY; }
int robot_is_parameter(unsigned vr) { return vr < LOADS; }

static void cross(const double a[3], const double b[3], double out[3]) {
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}

static double dot(const double a[3], const double b[3]) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

static void times(const double M[9], const double v[3], double out[3]) {
    for (int i = 0; i < 3; i++) out[i] = M[3 * i] * v[0] + M[3 * i + 1] * v[1] + M[3 * i + 2] * v[2];
}

static void times_transposed(const double M[9], const double v[3], double out[3]) {
    for (int i = 0; i < 3; i++) out[i] = M[i] * v[0] + M[3 + i] * v[1] + M[6 + i] * v[2];
}

/* R_IB of a quaternion of any length. */
static void rotation(const double q[4], double R[9]) {
    double s = 2.0 / (q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    double w = q[0], x = q[1], y = q[2], z = q[3];
    R[0] = 1 - s * (y * y + z * z), R[1] = s * (x * y - w * z), R[2] = s * (x * z + w * y);
    R[3] = s * (x * y + w * z), R[4] = 1 - s * (x * x + z * z), R[5] = s * (y * z - w * x);
    R[6] = s * (x * z - w * y), R[7] = s * (y * z + w * x), R[8] = 1 - s * (x * x + y * y);
}

static void inertia(const Robot *r, double J[9]) {
    const double *v = r->value + INERTIA;
    double tensor[9] = {v[0], v[3], v[4], v[3], v[1], v[5], v[4], v[5], v[2]};
    memcpy(J, tensor, sizeof tensor);
}

/* Return 0 if the tensor is not that of a body. */
static int invert(const double J[9], double out[9]) {
    double minors[9] = {
        J[4] * J[8] - J[5] * J[7], J[2] * J[7] - J[1] * J[8], J[1] * J[5] - J[2] * J[4],
        J[5] * J[6] - J[3] * J[8], J[0] * J[8] - J[2] * J[6], J[2] * J[3] - J[0] * J[5],
        J[3] * J[7] - J[4] * J[6], J[1] * J[6] - J[0] * J[7], J[0] * J[4] - J[1] * J[3]};
    double det = J[0] * minors[0] + J[1] * minors[3] + J[2] * minors[6];
    if (!(J[0] > 0 && minors[8] > 0 && det > 0)) return 0;
    for (int i = 0; i < 9; i++) out[i] = minors[i] / det;
    return 1;
}

/* From the centre of mass to wheel k, to b where k is N_WHEELS; in B. */
static void arm_B(const Robot *r, int k, double arm[3]) {
    for (int i = 0; i < 3; i++) {
        arm[i] = -r->value[CENTER_OF_MASS + i];
        if (k < N_WHEELS) arm[i] += r->value[MOUNT + 3 * k + i];
    }
}

static void show(Robot *r) {
    const double *x = r->state, *v = r->state + 7, *w = r->state + 10;
    double R[9], J[9], spin[3], momentum[3];
    rotation(r->state + 3, R);
    for (int k = 0; k <= N_WHEELS; k++) {
        double arm_b[3], arm[3], speed[3];
        double *out = k < N_WHEELS ? r->value + WHEEL + OF_WHEEL * k : r->value + BODY;
        int velocity = k < N_WHEELS ? 6 : 3;
        arm_B(r, k, arm_b);
        times(R, arm_b, arm);
        cross(w, arm, speed);
        for (int i = 0; i < 3; i++) {
            out[i] = x[i] + arm[i];
            out[velocity + i] = v[i] + speed[i];
            out[velocity + 3 + i] = w[i];
        }
        if (k < N_WHEELS) times(R, AXLE, out + 3);
    }
    double *body = r->value + BODY;
    double sine = R[6] > 1 ? 1 : R[6] < -1 ? -1 : R[6];
    body[9] = atan2(R[7], R[8]);
    body[10] = -asin(sine);
    body[11] = atan2(R[3], R[0]);
    inertia(r, J);
    times_transposed(R, w, spin);
    times(J, spin, momentum);
    body[12] = 0.5 * r->value[MASS] * dot(v, v) + 0.5 * dot(spin, momentum);
    body[13] = r->value[MASS] * r->value[GRAVITY] * x[2];
}

int robot_start(Robot *r) {
    double J[9], R[9], arm[3], b[3];
    const double *a = r->value + START_ANGLES;
    double cr = cos(a[0] / 2), cp = cos(a[1] / 2), cy = cos(a[2] / 2);
    double sr = sin(a[0] / 2), sp = sin(a[1] / 2), sy = sin(a[2] / 2);
    double q[4] = {cr * cp * cy + sr * sp * sy, sr * cp * cy - cr * sp * sy,
                   cr * sp * cy + sr * cp * sy, cr * cp * sy - sr * sp * cy};
    inertia(r, J);
    if (!(r->value[MASS] > 0) || !invert(J, r->inverse_inertia)) return 0;
    memcpy(r->state + 3, q, sizeof q);
    rotation(q, R);
    arm_B(r, N_WHEELS, arm);
    times(R, arm, b);
    for (int i = 0; i < 3; i++) {
        r->state[i] = r->value[START_POSITION + i] - b[i];
        r->state[7 + i] = r->value[START_VELOCITY + i];
        r->state[10 + i] = 0.0;
    }
    show(r);
    for (int k = 0; k < N_WHEELS; k++) { /* before the first step, means are the values */
        double *wheel = r->value + WHEEL + OF_WHEEL * k;
        memcpy(wheel + 12, wheel, 6 * sizeof(double));
        memset(wheel + 18, 0, 6 * sizeof(double));
    }
    return 1;
}

/* Write the time derivative of state and integrals. */
static void slope(const Robot *r, const double *y, double since_middle, double *dy) {
    const double *q = y + 3, *w = y + 10;
    double R[9], J[9], loads[N_LOADS], force[3], moment[3], arm_b[3], arm[3], lever[3], spin[3], momentum[3], gyro[3];
    double thrust_B[3] = {0, 0, 0}, turning[9];
    for (int i = 0; i < N_LOADS; i++) loads[i] = r->value[LOADS + i] + r->value[RATES + i] * since_middle;
    rotation(q, R);
    thrust_B[2] = loads[0];
    times(R, thrust_B, force);
    arm_B(r, N_WHEELS, arm_b);
    times(R, arm_b, arm);
    cross(arm, force, lever);
    times(R, loads + 1, moment);
    for (int i = 0; i < 3; i++) moment[i] += lever[i];
    for (int k = 0; k < N_WHEELS; k++) {
        const double *wrench = loads + 4 + 6 * k;
        double *dk = dy + N_STATE + 12 * k;
        arm_B(r, k, arm_b);
        times(R, arm_b, arm);
        cross(arm, wrench, lever);
        times(R, AXLE, dk + 3);
        for (int i = 0; i < 3; i++) {
            force[i] += wrench[i];
            moment[i] += lever[i] + wrench[3 + i];
            dk[i] = y[i] + arm[i];
            dk[6 + i] = w[i];
            dk[9 + i] = y[N_STATE + 12 * k + 6 + i];
        }
    }
    inertia(r, J);
    times_transposed(R, w, spin);
    times(J, spin, momentum);
    cross(spin, momentum, gyro);
    times_transposed(R, moment, turning);
    for (int i = 0; i < 3; i++) turning[i] -= gyro[i];
    times(r->inverse_inertia, turning, turning + 3);
    times(R, turning + 3, turning + 6);
    dy[3] = -0.5 * dot(w, q + 1);
    cross(w, q + 1, dy + 4);
    for (int i = 0; i < 3; i++) {
        dy[i] = y[7 + i];
        dy[4 + i] = 0.5 * (q[0] * w[i] + dy[4 + i]);
        dy[7 + i] = force[i] / r->value[MASS] - (i == 2 ? r->value[GRAVITY] : 0.0);
        dy[10 + i] = turning[6 + i];
    }
}

static void runge_kutta(const Robot *r, double *y, double since_middle, double h) {
    double k[4][N_ALL], trial[N_ALL];
    static const double AT[4] = {0.0, 0.5, 0.5, 1.0};
    for (int stage = 0; stage < 4; stage++) {
        for (int i = 0; i < N_ALL; i++) trial[i] = y[i] + (stage ? AT[stage] * h * k[stage - 1][i] : 0.0);
        slope(r, trial, since_middle + AT[stage] * h, k[stage]);
    }
    for (int i = 0; i < N_ALL; i++) y[i] += h / 6 * (k[0][i] + 2 * (k[1][i] + k[2][i]) + k[3][i]);
    double length = sqrt(y[3] * y[3] + y[4] * y[4] + y[5] * y[5] + y[6] * y[6]);
    for (int i = 3; i < 7; i++) y[i] /= length;
}

int robot_step(Robot *r, double H) {
    double y[N_ALL] = {0};
    int n = (int)ceil(H / LONGEST * (1 - 1e-9));
    if (!(H > 0)) return 0;
    memcpy(y, r->state, sizeof r->state);
    for (int i = 0; i < n; i++) runge_kutta(r, y, i * H / n - H / 2, H / n);
    for (int i = 0; i < N_ALL; i++)
        if (!isfinite(y[i])) return 0;
    memcpy(r->state, y, sizeof r->state);
    show(r);
    for (int k = 0; k < N_WHEELS; k++) {
        const double *sums = y + N_STATE + 12 * k; /* of position, axle, angular velocity, angle turned */
        double *wheel = r->value + WHEEL + OF_WHEEL * k + 12;
        for (int i = 0; i < 12; i++) wheel[i] = i / 3 == 2 ? sums[i] : sums[i] / H;
    }
    return 1;
}
