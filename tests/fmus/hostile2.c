/* Test FMU for FMI 2.0: x' = u, y = x; exact for held inputs. It misbehaves as the variable HOSTILE of its environment says,
 * "call fault time": in that call, once its time has come to `time`; faults are named below. Compiled by the tests. */
#define _GNU_SOURCE
#include <fenv.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

typedef void (*Logger)(void *, const char *, int, const char *, const char *, ...);
typedef struct { Logger log; } Callbacks;
typedef struct { double u, x, t; Logger log; } Hostile;
enum { VR_U = 1, VR_Y = 2, OK = 0, ERROR = 3, MANY = 3000 };

static int leaks(void) {
    for (char *block; (block = malloc(1 << 22)) != NULL;) memset(block, 1, 1 << 22);
    fprintf(stderr, "no memory is left\n");
    abort();
}
static void opens(void) {
    while (fopen("/dev/null", "r") != NULL) {}
    fprintf(stderr, "no file can be opened\n");
    abort();
}
static void floods(Hostile *m, int lines) {
    for (int i = 0; lines < 0 || i < lines; i++) {
        printf("line %d of many\n", i);
        if (m && m->log) m->log(NULL, "a", OK, "logAll", "message %d of many", i);
    }
}
static void changes_modes(void) {
    sigset_t all;
    sigfillset(&all);
    sigprocmask(SIG_BLOCK, &all, NULL);
    for (int number = 1; number < 32; number++) signal(number, SIG_IGN);
    fesetround(FE_TOWARDZERO);
    fesetround(FE_TONEAREST);
    alarm(1);
}
/* Return whether this call shall give numbers that are none. */
static int in(const char *call, Hostile *m) {
    char where[32] = "", fault[32] = "";
    double time = 0;
    const char *said = getenv("HOSTILE");
    if (!said || sscanf(said, "%31s %31s %lf", where, fault, &time) < 2 || strcmp(where, call) || (m ? m->t : 0) < time) return 0;
    if (!strcmp(fault, "crash")) { fprintf(stderr, "about to crash in %s\n", call); *(volatile int *)8 = 1; }
    if (!strcmp(fault, "exit")) exit(0);
    if (!strcmp(fault, "exec")) execl("/bin/sleep", "sleep", "1000", (char *)NULL);
    if (!strcmp(fault, "hang")) for (;;) pause();
    if (!strcmp(fault, "flood")) floods(m, MANY);
    if (!strcmp(fault, "pour")) floods(m, -1);
    if (!strcmp(fault, "leak")) leaks();
    if (!strcmp(fault, "open")) opens();
    if (!strcmp(fault, "cwd") && chdir("/")) abort();
    if (!strcmp(fault, "modes")) changes_modes();
    if (!strcmp(fault, "parent")) { kill(getppid(), SIGKILL); pause(); }
    return !strcmp(fault, "nan");
}

__attribute__((constructor)) static void load(void) { in("load", NULL); }
const char *fmi2GetVersion(void) { return "2.0"; }
const char *fmi2GetTypesPlatform(void) { return "default"; }
void *fmi2Instantiate(const char *name, int type, const char *guid, const char *path, const Callbacks *callbacks, int visible,
                      int logging) {
    Hostile *m = calloc(1, sizeof(Hostile));
    m->log = callbacks->log;
    in("instantiate", m);
    return m;
}
void fmi2FreeInstance(void *c) { in("free", c); free(c); }
int fmi2SetDebugLogging(void *c, int on, size_t n, const char *const categories[]) { return OK; }
int fmi2SetupExperiment(void *c, int t, double tolerance, double start, int s, double stop) { return in("setup", c), OK; }
int fmi2EnterInitializationMode(void *c) { return in("enter", c), OK; }
int fmi2ExitInitializationMode(void *c) { return in("exit", c), OK; }
int fmi2Terminate(void *c) { return in("terminate", c), OK; }
int fmi2Reset(void *c) { return OK; }
int fmi2GetReal(void *c, const unsigned vr[], size_t n, double values[]) {
    Hostile *m = c;
    int none = in("get", c);
    for (size_t i = 0; i < n; i++) values[i] = none ? 0.0 / 0.0 : vr[i] == VR_U ? m->u : m->x;
    return OK;
}
int fmi2SetReal(void *c, const unsigned vr[], size_t n, const double values[]) {
    Hostile *m = c;
    in("set", c);
    for (size_t i = 0; i < n; i++) *(vr[i] == VR_U ? &m->u : &m->x) = values[i];
    return OK;
}
int fmi2DoStep(void *c, double t, double h, int none_before) {
    Hostile *m = c;
    m->t = t;
    if (in("step", c)) m->x = 0.0 / 0.0;
    m->x += h * m->u;
    m->t = t + h;
    return OK;
}
int fmi2GetFMUstate(void *c, void **state) {
    in("save", c);
    if (!*state) *state = malloc(sizeof(Hostile));
    memcpy(*state, c, sizeof(Hostile));
    return OK;
}
int fmi2SetFMUstate(void *c, void *state) { in("restore", c); memcpy(c, state, sizeof(Hostile)); return OK; }
int fmi2FreeFMUstate(void *c, void **state) { in("forget", c); free(*state); *state = NULL; return OK; }
int fmi2GetDirectionalDerivative(void *c, const unsigned unknown[], size_t m, const unsigned known[], size_t n,
                                 const double seed[], double out[]) {
    out[0] = in("derivative", c) ? 0.0 / 0.0 : 0.0;
    return OK;
}
