/* Test FMU for FMI 1.0: x' = gain u, y = x, exact for held inputs; `on` switches it, `fault` is the status of a step. */
#include <stdlib.h>
#include <string.h>

typedef struct { double x, u, gain, fault; char on; int steps; } Lag;
enum { VR_U = 1, VR_Y, VR_GAIN, VR_START, VR_FAULT, VR_ON = 1, VR_STEPS = 1 };
#define FMI(name) lag1_fmi##name

const char *FMI(GetTypesPlatform)(void) { return "standard32"; }
const char *FMI(GetVersion)(void) { return "1.0"; }
typedef struct { void *logger, *allocate, *release, *finished; } Callbacks;
void *FMI(InstantiateSlave)(const char *name, const char *guid, const char *place, const char *type, double timeout, char visible,
                            char interactive, Callbacks callbacks, char logging) {
    if (strcmp(guid, "{lag1}") || !callbacks.logger) return NULL;
    Lag *lag = calloc(1, sizeof(Lag));
    lag->gain = lag->on = 1;
    return lag;
}
int FMI(InitializeSlave)(void *c, double start, char defined, double stop) { return 0; }
int FMI(TerminateSlave)(void *c) { return 0; }
int FMI(ResetSlave)(void *c) { return 0; }
void FMI(FreeSlaveInstance)(void *c) { free(c); }
int FMI(SetDebugLogging)(void *c, char on) { return 0; }
static double *place(Lag *lag, unsigned vr) {
    return vr == VR_U ? &lag->u : vr == VR_GAIN ? &lag->gain : vr == VR_FAULT ? &lag->fault : &lag->x;
}
int FMI(GetReal)(void *c, const unsigned vr[], size_t n, double values[]) {
    for (size_t i = 0; i < n; i++) values[i] = *place(c, vr[i]);
    return 0;
}
int FMI(SetReal)(void *c, const unsigned vr[], size_t n, const double values[]) {
    for (size_t i = 0; i < n; i++) *place(c, vr[i]) = values[i];
    return 0;
}
int FMI(GetInteger)(void *c, const unsigned vr[], size_t n, int values[]) {
    for (size_t i = 0; i < n; i++) values[i] = ((Lag *)c)->steps;
    return 0;
}
int FMI(SetInteger)(void *c, const unsigned vr[], size_t n, const int values[]) { return 3; }
int FMI(GetBoolean)(void *c, const unsigned vr[], size_t n, char values[]) {
    for (size_t i = 0; i < n; i++) values[i] = ((Lag *)c)->on;
    return 0;
}
int FMI(SetBoolean)(void *c, const unsigned vr[], size_t n, const char values[]) {
    for (size_t i = 0; i < n; i++) ((Lag *)c)->on = values[i];
    return 0;
}
int FMI(GetString)(void *c, const unsigned vr[], size_t n, const char *values[]) { return 3; }
int FMI(SetString)(void *c, const unsigned vr[], size_t n, const char *const values[]) { return 3; }
int FMI(SetRealInputDerivatives)(void *c, const unsigned vr[], size_t n, const int order[], const double v[]) { return 3; }
int FMI(GetRealOutputDerivatives)(void *c, const unsigned vr[], size_t n, const int order[], double v[]) { return 3; }
int FMI(DoStep)(void *c, double t, double h, char new_step) {
    Lag *lag = c;
    if (lag->fault && t > 0.55) return (int)lag->fault;
    if (lag->on) lag->x += h * lag->gain * lag->u;
    lag->steps += new_step;
    return 0;
}
int FMI(CancelStep)(void *c) { return 3; }
int FMI(GetStatus)(void *c, int kind, int *value) { return 3; }
int FMI(GetRealStatus)(void *c, int kind, double *value) { return 3; }
int FMI(GetIntegerStatus)(void *c, int kind, int *value) { return 3; }
int FMI(GetBooleanStatus)(void *c, int kind, char *value) { return 3; }
int FMI(GetStringStatus)(void *c, int kind, const char **value) { return 3; }
