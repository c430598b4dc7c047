/* FMI 2.0 for co-simulation around robot.c. The few declarations of the standard that are needed stand here, in its own words:
 * <https://fmi-standard.org>. Every function of the standard is there; what this robot has not answers with an error. */
#include <stdlib.h>
#include <string.h>

#include "robot.h"

#ifdef _WIN32
#define API __declspec(dllexport)
#else
#define API __attribute__((visibility("default")))
#endif

typedef void *fmi2Component;
typedef unsigned int fmi2ValueReference;
typedef double fmi2Real;
typedef int fmi2Integer;
typedef int fmi2Boolean;
typedef const char *fmi2String;
typedef char fmi2Byte;
typedef void *fmi2FMUstate;
typedef enum { fmi2OK, fmi2Warning, fmi2Discard, fmi2Error, fmi2Fatal, fmi2Pending } fmi2Status;
typedef struct {
    void (*logger)(void *environment, fmi2String name, fmi2Status status, fmi2String category, fmi2String message, ...);
    void *(*allocateMemory)(size_t, size_t);
    void (*freeMemory)(void *);
    void (*stepFinished)(void *, fmi2Status);
    void *environment;
} fmi2CallbackFunctions;

typedef struct {
    Robot robot;
    int running; /* initialised: parameters are fixed */
    const fmi2CallbackFunctions *callbacks;
    char name[64];
} Instance;

static fmi2Status fail(Instance *m, fmi2Status status, const char *message) {
    if (m->callbacks && m->callbacks->logger)
        m->callbacks->logger(m->callbacks->environment, m->name, status, "logStatusError", message);
    return status;
}

/* -- life -------------------------------------------------------------------------------------------------- */

API fmi2String fmi2GetVersion(void) { return "2.0"; }
API fmi2String fmi2GetTypesPlatform(void) { return "default"; }
API fmi2Component fmi2Instantiate(fmi2String name, int type, fmi2String guid, fmi2String place,
                                  const fmi2CallbackFunctions *callbacks, fmi2Boolean visible, fmi2Boolean logging) {
    Instance *m = calloc(1, sizeof *m);
    (void)type, (void)guid, (void)place, (void)visible, (void)logging;
    if (!m) return NULL;
    m->callbacks = callbacks;
    strncpy(m->name, name, sizeof m->name - 1);
    robot_defaults(&m->robot);
    return m;
}
API void fmi2FreeInstance(fmi2Component c) { free(c); }
API fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean t, fmi2Real tolerance, fmi2Real start, fmi2Boolean s,
                                    fmi2Real stop) {
    (void)c, (void)t, (void)tolerance, (void)start, (void)s, (void)stop;
    return fmi2OK;
}
API fmi2Status fmi2EnterInitializationMode(fmi2Component c) { (void)c; return fmi2OK; }
API fmi2Status fmi2ExitInitializationMode(fmi2Component c) {
    Instance *m = c;
    if (!robot_start(&m->robot)) return fail(m, fmi2Fatal, "mass and inertia are those of no body; make them positive");
    m->running = 1;
    return fmi2OK;
}
API fmi2Status fmi2Terminate(fmi2Component c) { (void)c; return fmi2OK; }
API fmi2Status fmi2Reset(fmi2Component c) {
    Instance *m = c;
    m->running = 0;
    robot_defaults(&m->robot);
    return fmi2OK;
}
API fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t n, const fmi2String categories[]) {
    (void)c, (void)on, (void)n, (void)categories;
    return fmi2OK;
}

/* -- variables --------------------------------------------------------------------------------------------- */

API fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Real values[]) {
    Instance *m = c;
    if (!m->running) robot_start(&m->robot); /* outputs follow the parameters before the start, too */
    for (size_t i = 0; i < n; i++) {
        if (vr[i] >= N_VARIABLES) return fail(m, fmi2Error, "there is no such variable");
        values[i] = m->robot.value[vr[i]];
    }
    return fmi2OK;
}
API fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Real values[]) {
    Instance *m = c;
    for (size_t i = 0; i < n; i++) {
        if (vr[i] >= N_VARIABLES || robot_is_output(vr[i])) return fail(m, fmi2Error, "this variable cannot be set");
        if (m->running && robot_is_parameter(vr[i])) return fail(m, fmi2Error, "parameters are fixed once it runs");
        m->robot.value[vr[i]] = values[i];
    }
    return fmi2OK;
}

/* -- a step, and the complete state ------------------------------------------------------------------------ */

API fmi2Status fmi2DoStep(fmi2Component c, fmi2Real t, fmi2Real H, fmi2Boolean none_before) {
    Instance *m = c;
    (void)t, (void)none_before;
    return robot_step(&m->robot, H) ? fmi2OK : fail(m, fmi2Discard, "the motion is no longer finite");
}
API fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *state) {
    Instance *m = c;
    if (!*state && !(*state = malloc(sizeof(Robot)))) return fail(m, fmi2Error, "no memory for the state");
    memcpy(*state, &m->robot, sizeof(Robot));
    return fmi2OK;
}
API fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate state) {
    memcpy(&((Instance *)c)->robot, state, sizeof(Robot));
    return fmi2OK;
}
API fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *state) {
    (void)c;
    free(*state);
    *state = NULL;
    return fmi2OK;
}
API fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate state, size_t *size) {
    (void)c, (void)state;
    *size = sizeof(Robot);
    return fmi2OK;
}
API fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate state, fmi2Byte bytes[], size_t size) {
    if (size < sizeof(Robot)) return fail(c, fmi2Error, "no room for the state");
    memcpy(bytes, state, sizeof(Robot));
    return fmi2OK;
}
API fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte bytes[], size_t size, fmi2FMUstate *state) {
    if (size != sizeof(Robot)) return fail(c, fmi2Error, "these are the bytes of another robot");
    if (!*state && !(*state = malloc(sizeof(Robot)))) return fail(c, fmi2Error, "no memory for the state");
    memcpy(*state, bytes, sizeof(Robot));
    return fmi2OK;
}

API fmi2Status fmi2GetBooleanStatus(fmi2Component c, int kind, fmi2Boolean *value) {
    (void)c, (void)kind;
    *value = 0; /* it never asks for the end of the simulation */
    return fmi2OK;
}

/* -- what this robot has not ------------------------------------------------------------------------------- */

#define NOT_THERE(function, ...) \
    API fmi2Status function(fmi2Component c, __VA_ARGS__) { return fail(c, fmi2Error, #function " is not there"); }
NOT_THERE(fmi2GetInteger, const fmi2ValueReference vr[], size_t n, fmi2Integer v[])
NOT_THERE(fmi2GetBoolean, const fmi2ValueReference vr[], size_t n, fmi2Boolean v[])
NOT_THERE(fmi2GetString, const fmi2ValueReference vr[], size_t n, fmi2String v[])
NOT_THERE(fmi2SetInteger, const fmi2ValueReference vr[], size_t n, const fmi2Integer v[])
NOT_THERE(fmi2SetBoolean, const fmi2ValueReference vr[], size_t n, const fmi2Boolean v[])
NOT_THERE(fmi2SetString, const fmi2ValueReference vr[], size_t n, const fmi2String v[])
NOT_THERE(fmi2GetDirectionalDerivative, const fmi2ValueReference u[], size_t m, const fmi2ValueReference k[], size_t n,
          const fmi2Real seed[], fmi2Real result[])
NOT_THERE(fmi2SetRealInputDerivatives, const fmi2ValueReference vr[], size_t n, const fmi2Integer order[], const fmi2Real v[])
NOT_THERE(fmi2GetRealOutputDerivatives, const fmi2ValueReference vr[], size_t n, const fmi2Integer order[], fmi2Real v[])
NOT_THERE(fmi2GetStatus, int kind, fmi2Status *v)
NOT_THERE(fmi2GetRealStatus, int kind, fmi2Real *v)
NOT_THERE(fmi2GetIntegerStatus, int kind, fmi2Integer *v)
NOT_THERE(fmi2GetStringStatus, int kind, fmi2String *v)
API fmi2Status fmi2CancelStep(fmi2Component c) { return fail(c, fmi2Error, "fmi2CancelStep is not there"); }
