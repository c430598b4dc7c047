/* Test FMU for FMI 3.0: y[i] = weight[i] u[i], i < n, a structural parameter of at most 8; x' = gain, a tunable parameter.
 * It holds its host to the standard: n in configuration mode alone, that before the initialisation, and sizes that fit. */
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

enum { MOST = 8 };
enum { VR_N = 1, VR_U, VR_Y, VR_GAIN, VR_X, VR_WEIGHT, OK = 0, ERROR = 3 };
typedef enum { INSTANTIATED, CONFIGURING, INITIALIZING, STEPPING } Mode;
typedef struct { uint64_t n; double u[MOST], weight[MOST], gain, x; Mode mode; } Sized;
typedef void (*Log)(void *, int, const char *, const char *);

void *fmi3InstantiateCoSimulation(const char *name, const char *token, const char *path, bool visible, bool logging,
                                  bool events, bool early, const uint32_t required[], size_t n, void *environment, Log log,
                                  void *update) {
    Sized *s = calloc(1, sizeof(Sized));
    s->n = 2;
    s->gain = 1.0;
    for (int i = 0; i < MOST; i++) s->weight[i] = 1.0;
    return s;
}
void fmi3FreeInstance(void *c) { free(c); }
static int moved(Sized *s, Mode from, Mode to) {
    if (s->mode != from) return ERROR;
    s->mode = to;
    return OK;
}
int fmi3EnterConfigurationMode(void *c) { return moved(c, INSTANTIATED, CONFIGURING); }
int fmi3ExitConfigurationMode(void *c) { return moved(c, CONFIGURING, INSTANTIATED); }
int fmi3EnterInitializationMode(void *c, bool t, double tolerance, double start, bool s, double stop) {
    return moved(c, INSTANTIATED, INITIALIZING);
}
int fmi3ExitInitializationMode(void *c) { return moved(c, INITIALIZING, STEPPING); }
int fmi3Terminate(void *c) { return OK; }
int fmi3SetUInt64(void *c, const uint32_t vr[], size_t n, const uint64_t values[], size_t size) {
    Sized *s = c;
    if (s->mode != CONFIGURING || n != 1 || vr[0] != VR_N || values[0] > MOST) return ERROR;
    s->n = values[0];
    return OK;
}
int fmi3GetUInt64(void *c, const uint32_t vr[], size_t n, uint64_t values[], size_t size) {
    values[0] = ((Sized *)c)->n;
    return OK;
}
static double *place(Sized *s, uint32_t vr, size_t *size) {
    *size = vr == VR_GAIN || vr == VR_X ? 1 : s->n;
    switch (vr) {
        case VR_U: return s->u;
        case VR_WEIGHT: return s->weight;
        case VR_GAIN: return &s->gain;
        case VR_X: return &s->x;
    }
    return NULL;
}
int fmi3GetFloat64(void *c, const uint32_t vr[], size_t n, double values[], size_t size) {
    Sized *s = c;
    size_t left = size, own;
    for (size_t k = 0; k < n; k++) {
        double *from = place(s, vr[k], &own);
        if (own > left) return ERROR;
        for (size_t i = 0; i < own; i++) *values++ = vr[k] == VR_Y ? s->weight[i] * s->u[i] : from[i];
        left -= own;
    }
    return left ? ERROR : OK;
}
int fmi3SetFloat64(void *c, const uint32_t vr[], size_t n, const double values[], size_t size) {
    Sized *s = c;
    size_t left = size, own;
    for (size_t k = 0; k < n; k++) {
        double *to = place(s, vr[k], &own);
        if (own > left || !to || vr[k] == VR_X || (vr[k] == VR_WEIGHT && s->mode == STEPPING)) return ERROR;
        for (size_t i = 0; i < own; i++) to[i] = *values++;
        left -= own;
    }
    return left ? ERROR : OK;
}
int fmi3DoStep(void *c, double t, double h, bool keep, bool *event, bool *terminate, bool *early, double *last) {
    Sized *s = c;
    if (s->mode != STEPPING) return ERROR;
    s->x += h * s->gain;
    *event = *terminate = *early = false;
    *last = t + h;
    return OK;
}
int fmi3GetFMUState(void *c, void **state) {
    if (!*state) *state = malloc(sizeof(Sized));
    *(Sized *)*state = *(Sized *)c;
    return OK;
}
int fmi3SetFMUState(void *c, void *state) { *(Sized *)c = *(Sized *)state; return OK; }
int fmi3FreeFMUState(void *c, void **state) { free(*state); *state = NULL; return OK; }
