/* FMI 3.0 for co-simulation around robot.c. The few declarations of the standard that are needed stand here, in its own words:
 * <https://fmi-standard.org>. Every function of the standard is there; what this robot has not answers with an error. */
#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "robot.h"

#ifdef _WIN32
#define API __declspec(dllexport)
#else
#define API __attribute__((visibility("default")))
#endif

typedef void *fmi3Instance;
typedef void *fmi3InstanceEnvironment;
typedef void *fmi3FMUState;
typedef uint32_t fmi3ValueReference;
typedef double fmi3Float64;
typedef bool fmi3Boolean;
typedef const char *fmi3String;
typedef uint8_t fmi3Byte;
typedef enum { fmi3OK, fmi3Warning, fmi3Discard, fmi3Error, fmi3Fatal } fmi3Status;
typedef void (*fmi3LogMessageCallback)(fmi3InstanceEnvironment, fmi3Status, fmi3String category, fmi3String message);

typedef struct {
    Robot robot;
    int running; /* initialised: parameters are fixed */
    fmi3LogMessageCallback log;
    fmi3InstanceEnvironment environment;
} Instance;

static fmi3Status fail(Instance *m, fmi3Status status, const char *message) {
    if (m && m->log) m->log(m->environment, status, "logStatusError", message);
    return status;
}

/* -- life -------------------------------------------------------------------------------------------------- */

API fmi3String fmi3GetVersion(void) { return "3.0"; }
API fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String place, fmi3Boolean visible,
                                             fmi3Boolean logging, fmi3Boolean events, fmi3Boolean early,
                                             const fmi3ValueReference required[], size_t n, fmi3InstanceEnvironment environment,
                                             fmi3LogMessageCallback log, void *update) {
    Instance *m = calloc(1, sizeof *m);
    (void)name, (void)token, (void)place, (void)visible, (void)logging, (void)events, (void)early, (void)required, (void)n;
    (void)update;
    if (!m) return NULL;
    m->log = log;
    m->environment = environment;
    robot_defaults(&m->robot);
    return m;
}
API fmi3Instance fmi3InstantiateModelExchange(void) { return NULL; }
API fmi3Instance fmi3InstantiateScheduledExecution(void) { return NULL; }
API void fmi3FreeInstance(fmi3Instance c) { free(c); }
API fmi3Status fmi3EnterInitializationMode(fmi3Instance c, fmi3Boolean t, fmi3Float64 tolerance, fmi3Float64 start,
                                           fmi3Boolean s, fmi3Float64 stop) {
    (void)t, (void)tolerance, (void)s, (void)stop;
    ((Instance *)c)->robot.time = start;
    return fmi3OK;
}
API fmi3Status fmi3ExitInitializationMode(fmi3Instance c) {
    Instance *m = c;
    if (!robot_start(&m->robot)) return fail(m, fmi3Fatal, "mass and inertia are those of no body; make them positive");
    m->running = 1;
    return fmi3OK;
}
API fmi3Status fmi3Terminate(fmi3Instance c) { (void)c; return fmi3OK; }
API fmi3Status fmi3Reset(fmi3Instance c) {
    Instance *m = c;
    m->running = 0;
    robot_defaults(&m->robot);
    return fmi3OK;
}
API fmi3Status fmi3SetDebugLogging(fmi3Instance c, fmi3Boolean on, size_t n, const fmi3String categories[]) {
    (void)c, (void)on, (void)n, (void)categories;
    return fmi3OK;
}

/* -- variables --------------------------------------------------------------------------------------------- */

API fmi3Status fmi3GetFloat64(fmi3Instance c, const fmi3ValueReference vr[], size_t n, fmi3Float64 values[], size_t size) {
    (void)size; /* all are scalars: as many as n */
    Instance *m = c;
    if (!m->running) robot_start(&m->robot); /* outputs follow the parameters before the start, too */
    for (size_t i = 0; i < n; i++) {
        if (vr[i] > N_VARIABLES) return fail(m, fmi3Error, "there is no such variable");
        values[i] = vr[i] == N_VARIABLES ? m->robot.time : m->robot.value[vr[i]]; /* the last one is time */
    }
    return fmi3OK;
}
API fmi3Status fmi3SetFloat64(fmi3Instance c, const fmi3ValueReference vr[], size_t n, const fmi3Float64 values[],
                              size_t size) {
    (void)size;
    Instance *m = c;
    for (size_t i = 0; i < n; i++) {
        if (vr[i] >= N_VARIABLES || robot_is_output(vr[i])) return fail(m, fmi3Error, "this variable cannot be set");
        if (m->running && robot_is_parameter(vr[i])) return fail(m, fmi3Error, "parameters are fixed once it runs");
        m->robot.value[vr[i]] = values[i];
    }
    return fmi3OK;
}

/* -- a step, and the complete state ------------------------------------------------------------------------ */

API fmi3Status fmi3DoStep(fmi3Instance c, fmi3Float64 t, fmi3Float64 H, fmi3Boolean none_before, fmi3Boolean *event,
                          fmi3Boolean *terminate, fmi3Boolean *early, fmi3Float64 *reached) {
    Instance *m = c;
    (void)none_before;
    *event = *terminate = *early = false;
    *reached = t;
    if (!robot_step(&m->robot, H)) return fail(m, fmi3Discard, "the motion is no longer finite");
    *reached = m->robot.time = t + H;
    return fmi3OK;
}
API fmi3Status fmi3GetFMUState(fmi3Instance c, fmi3FMUState *state) {
    Instance *m = c;
    if (!*state && !(*state = malloc(sizeof(Robot)))) return fail(m, fmi3Error, "no memory for the state");
    memcpy(*state, &m->robot, sizeof(Robot));
    return fmi3OK;
}
API fmi3Status fmi3SetFMUState(fmi3Instance c, fmi3FMUState state) {
    memcpy(&((Instance *)c)->robot, state, sizeof(Robot));
    return fmi3OK;
}
API fmi3Status fmi3FreeFMUState(fmi3Instance c, fmi3FMUState *state) {
    (void)c;
    free(*state);
    *state = NULL;
    return fmi3OK;
}
API fmi3Status fmi3SerializedFMUStateSize(fmi3Instance c, fmi3FMUState state, size_t *size) {
    (void)c, (void)state;
    *size = sizeof(Robot);
    return fmi3OK;
}
API fmi3Status fmi3SerializeFMUState(fmi3Instance c, fmi3FMUState state, fmi3Byte bytes[], size_t size) {
    if (size < sizeof(Robot)) return fail(c, fmi3Error, "no room for the state");
    memcpy(bytes, state, sizeof(Robot));
    return fmi3OK;
}
API fmi3Status fmi3DeserializeFMUState(fmi3Instance c, const fmi3Byte bytes[], size_t size, fmi3FMUState *state) {
    if (size != sizeof(Robot)) return fail(c, fmi3Error, "these are the bytes of another robot");
    if (!*state && !(*state = malloc(sizeof(Robot)))) return fail(c, fmi3Error, "no memory for the state");
    memcpy(*state, bytes, sizeof(Robot));
    return fmi3OK;
}

/* -- what this robot has not: further arguments are left where they are ------------------------------------- */

#define NOT_THERE(function) \
    API fmi3Status function(fmi3Instance c) { return fail(c, fmi3Error, #function " is not there"); }
NOT_THERE(fmi3GetFloat32) NOT_THERE(fmi3SetFloat32) NOT_THERE(fmi3GetInt8) NOT_THERE(fmi3SetInt8)
NOT_THERE(fmi3GetUInt8) NOT_THERE(fmi3SetUInt8) NOT_THERE(fmi3GetInt16) NOT_THERE(fmi3SetInt16) NOT_THERE(fmi3GetUInt16)
NOT_THERE(fmi3SetUInt16) NOT_THERE(fmi3GetInt32) NOT_THERE(fmi3SetInt32) NOT_THERE(fmi3GetUInt32)
NOT_THERE(fmi3SetUInt32) NOT_THERE(fmi3GetInt64) NOT_THERE(fmi3SetInt64) NOT_THERE(fmi3GetUInt64)
NOT_THERE(fmi3SetUInt64) NOT_THERE(fmi3GetBoolean) NOT_THERE(fmi3SetBoolean) NOT_THERE(fmi3GetString)
NOT_THERE(fmi3SetString) NOT_THERE(fmi3GetBinary) NOT_THERE(fmi3SetBinary) NOT_THERE(fmi3GetClock)
NOT_THERE(fmi3SetClock) NOT_THERE(fmi3GetNumberOfVariableDependencies) NOT_THERE(fmi3GetVariableDependencies)
NOT_THERE(fmi3GetDirectionalDerivative) NOT_THERE(fmi3GetAdjointDerivative) NOT_THERE(fmi3EnterConfigurationMode)
NOT_THERE(fmi3ExitConfigurationMode) NOT_THERE(fmi3GetIntervalDecimal) NOT_THERE(fmi3GetIntervalFraction)
NOT_THERE(fmi3GetShiftDecimal) NOT_THERE(fmi3GetShiftFraction) NOT_THERE(fmi3SetIntervalDecimal)
NOT_THERE(fmi3SetIntervalFraction) NOT_THERE(fmi3SetShiftDecimal) NOT_THERE(fmi3SetShiftFraction)
NOT_THERE(fmi3EvaluateDiscreteStates) NOT_THERE(fmi3UpdateDiscreteStates) NOT_THERE(fmi3EnterEventMode)
NOT_THERE(fmi3EnterContinuousTimeMode) NOT_THERE(fmi3CompletedIntegratorStep) NOT_THERE(fmi3SetTime)
NOT_THERE(fmi3SetContinuousStates) NOT_THERE(fmi3GetContinuousStateDerivatives) NOT_THERE(fmi3GetEventIndicators)
NOT_THERE(fmi3GetContinuousStates) NOT_THERE(fmi3GetNominalsOfContinuousStates)
NOT_THERE(fmi3GetNumberOfEventIndicators) NOT_THERE(fmi3GetNumberOfContinuousStates) NOT_THERE(fmi3EnterStepMode)
NOT_THERE(fmi3GetOutputDerivatives) NOT_THERE(fmi3ActivateModelPartition)
