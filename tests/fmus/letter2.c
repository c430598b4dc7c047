/* Test FMU for FMI 2.0: x' = -x + u by 100 Euler steps, so that a step costs little and hangs on its length.
 * `tentative`: a step after which older states may be restored counts as tentative: the next one starts where it started.
 * From `fault_time` on a step comes back as `fault` says: with a status of that number, or after one of the messages below. */
#include <stdlib.h>
#include <string.h>

typedef void (*Logger)(void *, const char *, int, const char *, const char *, ...);
typedef struct { Logger log; void *(*allocate)(size_t, size_t); void (*release)(void *); void *finished, *environment; } Callbacks;
typedef struct { double x, u, before, tentative, fault, fault_time, reached; int open, over; Callbacks callbacks; } Letter;
enum { VR_U = 1, VR_X, VR_RATE, VR_START, VR_TENTATIVE, VR_FAULT, VR_FAULT_TIME };
enum { TERMINATES = 10, FORMATS, WORDS, STRAY };
enum { OK = 0, DISCARD = 2, ERROR = 3, TERMINATED = 3, LAST_TIME = 2 };

const char *fmi2GetVersion(void) { return "2.0"; }
const char *fmi2GetTypesPlatform(void) { return "default"; }
void *fmi2Instantiate(const char *name, int type, const char *guid, const char *path, const Callbacks *callbacks, int visible,
                      int logging) {
    Letter *m = calloc(1, sizeof(Letter));
    m->x = 1.0;
    m->callbacks = *callbacks;
    return m;
}
void fmi2FreeInstance(void *c) { free(c); }
int fmi2SetupExperiment(void *c, int t, double tolerance, double start, int s, double stop) { ((Letter *)c)->reached = start; return OK; }
int fmi2EnterInitializationMode(void *c) { return OK; }
int fmi2ExitInitializationMode(void *c) { return OK; }
int fmi2Terminate(void *c) { return OK; }
static double *place(Letter *m, unsigned vr) {
    switch (vr) {
        case VR_U: return &m->u;
        case VR_X: case VR_START: return &m->x;
        case VR_TENTATIVE: return &m->tentative;
        case VR_FAULT: return &m->fault;
        case VR_FAULT_TIME: return &m->fault_time;
    }
    return NULL;
}
int fmi2GetReal(void *c, const unsigned vr[], size_t n, double values[]) {
    Letter *m = c;
    for (size_t i = 0; i < n; i++) values[i] = vr[i] == VR_RATE ? m->u - m->x : *place(m, vr[i]);
    return OK;
}
int fmi2SetReal(void *c, const unsigned vr[], size_t n, const double values[]) {
    for (size_t i = 0; i < n; i++) *place(c, vr[i]) = values[i];
    return OK;
}
int fmi2GetFMUstate(void *c, void **state) {
    if (!*state) *state = malloc(sizeof(Letter));
    memcpy(*state, c, sizeof(Letter));
    return OK;
}
int fmi2SetFMUstate(void *c, void *state) { memcpy(c, state, sizeof(Letter)); return OK; }
int fmi2FreeFMUstate(void *c, void **state) { free(*state); *state = NULL; return OK; }
int fmi2GetBooleanStatus(void *c, int kind, int *value) { *value = kind == TERMINATED && ((Letter *)c)->over; return OK; }
int fmi2GetRealStatus(void *c, int kind, double *value) { *value = ((Letter *)c)->reached; return kind == LAST_TIME ? OK : ERROR; }
static int says(Letter *m, const char *format, int formats) {
    void *to = m->callbacks.environment;
    if (formats) m->callbacks.log(to, "a", ERROR, "logStatusError", format, "tyre model", 1234.5, 1000, 123, 'N', 1.5, (size_t)7);
    else m->callbacks.log(to, "a", ERROR, "logStatusError", format);
    m->callbacks.log(to, "a", OK, "logAll", "closing the file");
    return ERROR;
}
static int faulty(Letter *m) {
    int fault = (int)m->fault;
    if (fault == TERMINATES) { m->over = 1; return DISCARD; }
    if (fault == FORMATS) return says(m, "%s failed: %g N is above %d (%d%% of what is allowed), %c, %-8.3f|%zu", 1);
    if (fault == WORDS) return says(m, "Newton's method failed.\nA smaller step may help, or 50% of the load", 0);
    if (fault == STRAY) return says(m, "%s: 100 % of %s", 0);
    return fault;
}
int fmi2DoStep(void *c, double t, double h, int none_before) {
    Letter *m = c;
    if (m->fault && t + h > m->fault_time) return faulty(m);
    if (m->tentative && m->open) m->x = m->before;
    m->before = m->x;
    m->open = !none_before;
    for (int i = 0; i < 100; i++) m->x += h / 100 * (m->u - m->x);
    m->reached = t + h;
    return OK;
}
