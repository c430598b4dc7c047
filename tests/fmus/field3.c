/* Test FMU for FMI 3.0: `field.h` behind arrays u, y, x, der(x) of three elements. */
#include "field.h"
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum { FEED = 5, CUBIC, MODE, START, OK = 0, ERROR = 3 }; /* value references 1 … 4: U, Y, X, DX */

void *fmi3InstantiateCoSimulation(const char *name, const char *token, const char *path, bool visible, bool logging,
                                  bool events, bool early, const uint32_t required[], size_t n, void *environment, void *log,
                                  void *update) {
    return calloc(1, sizeof(Field));
}
void fmi3FreeInstance(void *c) { free(c); }
int fmi3EnterInitializationMode(void *c, bool t, double tolerance, double start, bool s, double stop) { return OK; }
int fmi3ExitInitializationMode(void *c) { return OK; }
int fmi3GetFloat64(void *c, const uint32_t vr[], size_t n, double values[], size_t size) {
    for (size_t i = 0; i < n; i++) {
        if (vr[i] < 1 || vr[i] > 4) return ERROR;
        for (int k = 0; k < N; k++) *values++ = value(c, vr[i] - 1, k);
    }
    return OK;
}
int fmi3SetFloat64(void *c, const uint32_t vr[], size_t n, const double values[], size_t size) {
    Field *f = c;
    for (size_t i = 0; i < n; i++) {
        if (vr[i] == 1) for (int k = 0; k < N; k++) f->u[k] = *values++;
        else if (vr[i] == FEED) f->feed = *values++;
        else if (vr[i] == CUBIC) f->cubic = *values++;
        else if (vr[i] == MODE) f->mode = *values++;
        else if (vr[i] == START) f->x[0] = *values++;
        else return ERROR;
    }
    return OK;
}
int fmi3DoStep(void *c, double t, double h, bool keep, bool *event, bool *terminate, bool *early, double *last) {
    advance(c, h);
    *event = *terminate = *early = false;
    *last = t + h;
    return OK;
}
int fmi3GetDirectionalDerivative(void *c, const uint32_t unknown[], size_t m, const uint32_t known[], size_t n,
                                 const double seed[], size_t seeds, double sensitivity[], size_t sensitivities) {
    Field *f = c;
    if (f->mode >= STATUS) return (int)f->mode - STATUS;
    for (size_t i = 0; i < m * N; i++) {
        sensitivity[i] = 0;
        for (size_t j = 0; j < n * N; j++)
            sensitivity[i] += partial(f, unknown[i / N] - 1, i % N, known[j / N] - 1, j % N) * seed[j];
    }
    return seeds == n * N && sensitivities == m * N ? OK : ERROR;
}
int fmi3GetFMUState(void *c, void **state) {
    if (!*state) *state = malloc(sizeof(Field));
    memcpy(*state, c, sizeof(Field));
    return OK;
}
int fmi3SetFMUState(void *c, void *state) { memcpy(c, state, sizeof(Field)); return OK; }
int fmi3FreeFMUState(void *c, void **state) { free(*state); *state = NULL; return OK; }
