/* Test FMU for FMI 2.0: x' = gain u, y = x; exact for held inputs. Compiled by tests and benchmarks where there is a compiler.
 * A step takes `duration` s of sleep, or -`duration` s of work; from `fault_time` on it comes back with status `fault`, if
 * that is one; the other faults are named below. */
#define _POSIX_C_SOURCE 200809L
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

typedef struct { double u, x, gain, duration, fault, fault_time; } Lag;
enum { NOT_A_NUMBER = 10, FORGETS, NO_RESTORE, NO_SAVE, NO_INPUT, NO_START, NO_END_OF_START, CRASHES = 20, HANGS };
enum { VR_U = 1, VR_Y = 2, VR_GAIN = 3, VR_START = 4, VR_DURATION, VR_FAULT, VR_FAULT_TIME, OK = 0, ERROR = 3 };

const char *fmi2GetVersion(void) { return "2.0"; }
const char *fmi2GetTypesPlatform(void) { return "default"; }
void *fmi2Instantiate(const char *name, int type, const char *guid, const char *path, const void *callbacks, int visible,
                      int logging) {
    if (strcmp(guid, "{lag2}")) return NULL;
    Lag *lag = calloc(1, sizeof(Lag));
    lag->gain = 1.0;
    return lag;
}
void fmi2FreeInstance(void *c) { free(c); }
int fmi2SetDebugLogging(void *c, int on, size_t n, const char *const categories[]) { return OK; }
int fmi2SetupExperiment(void *c, int t, double tolerance, double start, int s, double stop) { return OK; }
static int faulty(void *c, int fault) { return ((Lag *)c)->fault == fault ? ERROR : OK; }
int fmi2EnterInitializationMode(void *c) { return faulty(c, NO_START); }
int fmi2ExitInitializationMode(void *c) { return faulty(c, NO_END_OF_START); }
int fmi2Terminate(void *c) { return OK; }
int fmi2Reset(void *c) { return OK; }
int fmi2GetReal(void *c, const unsigned vr[], size_t n, double values[]) {
    Lag *lag = c;
    for (size_t i = 0; i < n; i++) {
        if (vr[i] == VR_Y) values[i] = lag->x;
        else if (vr[i] == VR_U) values[i] = lag->u;
        else if (vr[i] == VR_GAIN) values[i] = lag->gain;
        else if (vr[i] == VR_START) values[i] = lag->x;
        else if (vr[i] == VR_DURATION) values[i] = lag->duration;
        else if (vr[i] == VR_FAULT) values[i] = lag->fault;
        else if (vr[i] == VR_FAULT_TIME) values[i] = lag->fault_time;
        else return ERROR;
    }
    return OK;
}
int fmi2SetReal(void *c, const unsigned vr[], size_t n, const double values[]) {
    Lag *lag = c;
    for (size_t i = 0; i < n; i++) {
        if (vr[i] == VR_U && lag->fault == NO_INPUT) return ERROR;
        else if (vr[i] == VR_U) lag->u = values[i];
        else if (vr[i] == VR_GAIN) lag->gain = values[i];
        else if (vr[i] == VR_START) lag->x = values[i];
        else if (vr[i] == VR_DURATION) lag->duration = values[i];
        else if (vr[i] == VR_FAULT) lag->fault = values[i];
        else if (vr[i] == VR_FAULT_TIME) lag->fault_time = values[i];
        else return ERROR;
    }
    return OK;
}
static double clock_s(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return now.tv_sec + 1e-9 * now.tv_nsec;
}
static void take(double duration) {
    if (duration > 0) {
        struct timespec rest = {(time_t)duration, (long)(1e9 * (duration - (time_t)duration))};
        nanosleep(&rest, NULL);
    }
    for (double start = duration < 0 ? clock_s() : 0; duration < 0 && clock_s() - start < -duration;) {}
}
int fmi2DoStep(void *c, double t, double h, int no_rollback) {
    Lag *lag = c;
    if (lag->duration != 0) take(lag->duration);
    lag->x += h * lag->gain * lag->u;
    if (lag->fault == CRASHES && t >= lag->fault_time) raise(SIGSEGV);
    while (lag->fault == HANGS && t >= lag->fault_time) {}
    if (t < lag->fault_time || lag->fault > NOT_A_NUMBER) return OK;
    if (lag->fault == NOT_A_NUMBER) lag->x = 0.0 / 0.0;
    return lag->fault == NOT_A_NUMBER ? OK : (int)lag->fault;
}
int fmi2GetFMUstate(void *c, void **state) {
    if (faulty(c, NO_SAVE)) return ERROR;
    if (!*state) *state = malloc(sizeof(Lag));
    memcpy(*state, c, sizeof(Lag));
    return OK;
}
int fmi2SetFMUstate(void *c, void *state) {
    if (faulty(c, NO_RESTORE)) return ERROR;
    memcpy(c, state, sizeof(Lag));
    if (faulty(c, FORGETS)) ((Lag *)c)->x += 1e-3;
    return OK;
}
int fmi2FreeFMUstate(void *c, void **state) { free(*state); *state = NULL; return OK; }
