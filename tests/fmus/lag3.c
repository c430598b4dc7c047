/* Test FMU for FMI 3.0: x' = u[0] + u[1], y = {x, 2 x}; exact for held inputs. Compiled by the tests where there is a compiler. */
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

typedef struct { double u[2], x; int32_t count; } Lag;
typedef void (*Log)(void *, int, const char *, const char *);
enum { VR_U = 1, VR_Y = 2, VR_COUNT = 3, VR_FLAG = 4, VR_START = 5, OK = 0, ERROR = 3 };

void *fmi3InstantiateCoSimulation(const char *name, const char *token, const char *path, bool visible, bool logging,
                                  bool events, bool early, const uint32_t required[], size_t n, void *environment, Log log,
                                  void *update) {
    log(environment, 0, "logAll", "made for 100% of the tests");
    return calloc(1, sizeof(Lag));
}
void fmi3FreeInstance(void *c) { free(c); }
int fmi3EnterInitializationMode(void *c, bool t, double tolerance, double start, bool s, double stop) { return OK; }
int fmi3ExitInitializationMode(void *c) { return OK; }
int fmi3GetFloat64(void *c, const uint32_t vr[], size_t n, double values[], size_t size) {
    Lag *lag = c;
    for (size_t i = 0; i < n; i++) {
        if (vr[i] == VR_U) { *values++ = lag->u[0]; *values++ = lag->u[1]; }
        else if (vr[i] == VR_Y) { *values++ = lag->x; *values++ = 2 * lag->x; }
        else return ERROR;
    }
    return OK;
}
int fmi3SetFloat64(void *c, const uint32_t vr[], size_t n, const double values[], size_t size) {
    Lag *lag = c;
    for (size_t i = 0; i < n; i++) {
        if (vr[i] == VR_U) { lag->u[0] = *values++; lag->u[1] = *values++; }
        else if (vr[i] == VR_START) lag->x = *values++;
        else return ERROR;
    }
    return OK;
}
int fmi3GetInt32(void *c, const uint32_t vr[], size_t n, int32_t values[], size_t size) {
    values[0] = ((Lag *)c)->count;
    return OK;
}
int fmi3GetBoolean(void *c, const uint32_t vr[], size_t n, bool values[], size_t size) {
    values[0] = ((Lag *)c)->count % 2;
    return OK;
}
int fmi3DoStep(void *c, double t, double h, bool keep, bool *event, bool *terminate, bool *early, double *last) {
    Lag *lag = c;
    lag->x += h * (lag->u[0] + lag->u[1]);
    lag->count++;
    *event = *terminate = *early = false;
    *last = t + h;
    return OK;
}
int fmi3GetFMUState(void *c, void **state) {
    if (!*state) *state = malloc(sizeof(Lag));
    *(Lag *)*state = *(Lag *)c;
    return OK;
}
int fmi3SetFMUState(void *c, void *state) { *(Lag *)c = *(Lag *)state; return OK; }
int fmi3FreeFMUState(void *c, void **state) { free(*state); *state = NULL; return OK; }
