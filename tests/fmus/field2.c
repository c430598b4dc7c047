/* Test FMU for FMI 2.0: `field.h` behind scalars u[1] … u[3], y, x, der(x). */
#include "field.h"

enum { FEED = 13, CUBIC, MODE, START, OK = 0, ERROR = 3 }; /* value references 1 … 12: U, Y, X, DX by threes */

const char *fmi2GetVersion(void) { return "2.0"; }
const char *fmi2GetTypesPlatform(void) { return "default"; }
void *fmi2Instantiate(const char *name, int type, const char *guid, const char *path, const void *callbacks, int visible,
                      int logging) {
    return calloc(1, sizeof(Field));
}
void fmi2FreeInstance(void *c) { free(c); }
int fmi2SetDebugLogging(void *c, int on, size_t n, const char *const categories[]) { return OK; }
int fmi2SetupExperiment(void *c, int t, double tolerance, double start, int s, double stop) { return OK; }
int fmi2EnterInitializationMode(void *c) { return OK; }
int fmi2ExitInitializationMode(void *c) { return OK; }
int fmi2Terminate(void *c) { return OK; }
int fmi2Reset(void *c) { return OK; }
int fmi2GetReal(void *c, const unsigned vr[], size_t n, double values[]) {
    for (size_t i = 0; i < n; i++) {
        if (vr[i] < 1 || vr[i] > 12) return ERROR;
        values[i] = value(c, (vr[i] - 1) / N, (vr[i] - 1) % N);
    }
    return OK;
}
int fmi2SetReal(void *c, const unsigned vr[], size_t n, const double values[]) {
    Field *f = c;
    for (size_t i = 0; i < n; i++) {
        if (vr[i] <= N) f->u[vr[i] - 1] = values[i];
        else if (vr[i] == FEED) f->feed = values[i];
        else if (vr[i] == CUBIC) f->cubic = values[i];
        else if (vr[i] == MODE) f->mode = values[i];
        else if (vr[i] == START) f->x[0] = values[i];
        else return ERROR;
    }
    return OK;
}
int fmi2DoStep(void *c, double t, double h, int no_rollback) { advance(c, h); return OK; }
int fmi2GetDirectionalDerivative(void *c, const unsigned unknown[], size_t m, const unsigned known[], size_t n,
                                 const double seed[], double sensitivity[]) {
    Field *f = c;
    if (f->mode >= STATUS) return (int)f->mode - STATUS;
    for (size_t i = 0; i < m; i++) {
        sensitivity[i] = 0;
        for (size_t j = 0; j < n; j++) {
            double p = partial(f, (unknown[i] - 1) / N, (unknown[i] - 1) % N, (known[j] - 1) / N, (known[j] - 1) % N);
            sensitivity[i] += p * seed[j];
        }
    }
    return OK;
}
int fmi2GetFMUstate(void *c, void **state) {
    if (!*state) *state = malloc(sizeof(Field));
    memcpy(*state, c, sizeof(Field));
    return OK;
}
int fmi2SetFMUstate(void *c, void *state) { memcpy(c, state, sizeof(Field)); return OK; }
int fmi2FreeFMUstate(void *c, void **state) { free(*state); *state = NULL; return OK; }
