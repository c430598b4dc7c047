/* A field of three coupled states: x' = A x - cubic x³ + u, y = x + feed u, with all it can say about its derivatives.
 * Linear (cubic = 0) the Runge-Kutta steps inside are exact to 1e-9 or better for |A| h < 0.5. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { N = 3, INNER = 32 };
enum { U, Y, X, DX };
enum { OVER_STEP = 1, AT_INSTANT = 2, WRONG = 3, NOT_A_NUMBER = 4, STATUS = 10 }; /* from STATUS on: that status + 10 */

static const double A[N][N] = {{-3, 1, 0.5}, {1, -4, 1}, {0.2, 1, -2}};

typedef struct { double x[N], u[N], before[N], h, feed, cubic, mode; } Field;

static void rate(const Field *f, const double x[], double dx[]) {
    for (int i = 0; i < N; i++) {
        dx[i] = f->u[i] - f->cubic * x[i] * x[i] * x[i];
        for (int j = 0; j < N; j++) dx[i] += A[i][j] * x[j];
    }
}
static void advance(Field *f, double h) {
    double k[4][N], z[N], s = h / INNER;
    memcpy(f->before, f->x, sizeof f->x);
    f->h = h;
    for (int n = 0; n < INNER; n++) {
        for (int stage = 0; stage < 4; stage++) {
            double c = stage == 0 ? 0 : stage == 3 ? s : s / 2;
            for (int i = 0; i < N; i++) z[i] = f->x[i] + (stage ? c * k[stage - 1][i] : 0);
            rate(f, z, k[stage]);
        }
        for (int i = 0; i < N; i++) f->x[i] += s / 6 * (k[0][i] + 2 * k[1][i] + 2 * k[2][i] + k[3][i]);
    }
}
/* dx_i(t + h)/du_j of the step just made, by central differences of the step itself */
static double response(const Field *f, int i, int j) {
    double x[2];
    if (f->h == 0) return 0;
    for (int side = 0; side < 2; side++) {
        Field copy = *f;
        memcpy(copy.x, f->before, sizeof copy.x);
        copy.u[j] += side ? 1e-4 : -1e-4;
        advance(&copy, f->h);
        x[side] = copy.x[i];
    }
    return (x[1] - x[0]) / 2e-4;
}
static double partial(const Field *f, int unknown, int i, int known, int j) {
    double same = i == j, factor = f->mode == WRONG ? -2 : 1;
    if (f->mode == NOT_A_NUMBER) return NAN;
    if (unknown == Y && known == U) return factor * (f->feed * same + (f->mode == OVER_STEP ? response(f, i, j) : 0));
    if (unknown == Y && known == X) return factor * same;
    if (unknown == DX && known == U) return factor * same;
    if (unknown == DX && known == X) return factor * (A[i][j] - 3 * f->cubic * f->x[i] * f->x[i] * same);
    return 0;
}
static double value(const Field *f, int kind, int i) {
    double dx[N];
    rate(f, f->x, dx);
    return kind == U ? f->u[i] : kind == X ? f->x[i] : kind == DX ? dx[i] : f->x[i] + f->feed * f->u[i];
}
