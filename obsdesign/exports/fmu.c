
/* Types of the interface FMI 2.0, as its standard fixes them. */
#if defined _WIN32
#define EXPORT __declspec(dllexport)
#elif defined __GNUC__
#define EXPORT __attribute__((visibility("default")))
#else
#define EXPORT
#endif
#ifndef FMI2_FUNCTION_PREFIX /* a library that is linked with others defines one */
#define FMI2_FUNCTION_PREFIX
#endif
#define PASTED(a, b) a##b
#define JOINED(a, b) PASTED(a, b)
#define F(name) JOINED(FMI2_FUNCTION_PREFIX, name)

typedef enum { fmi2OK, fmi2Warning, fmi2Discard, fmi2Error, fmi2Fatal, fmi2Pending } fmi2Status;
typedef enum { fmi2ModelExchange, fmi2CoSimulation } fmi2Type;
typedef enum { fmi2DoStepStatus, fmi2PendingStatus, fmi2LastSuccessfulTime, fmi2Terminated } fmi2StatusKind;
typedef struct {
    void (*logger)(void *environment, const char *instance, fmi2Status status, const char *category,
                   const char *message, ...);
    void *(*allocateMemory)(size_t count, size_t size);
    void (*freeMemory)(void *memory);
    void (*stepFinished)(void *environment, fmi2Status status);
    void *environment;
} fmi2CallbackFunctions;

/* Places of the variables: their value references. */
enum { U = 0, Y = U + OBS(NU), HAT = Y + OBS(NY), XHAT0 = HAT + OBS(NE), ALL = XHAT0 + PARAMETERS };
enum { INSTANTIATED, INITIALIZING, STEPPING, TERMINATED };

/* What changes in a run; a copy of it is a state of the FMU. */
typedef struct {
    OBS(state) s;
    double t;            /* s, the point of communication that is reached */
    OBS(real) v[ALL];    /* values of the variables */
    OBS(real) u[OBS(NU) + 1]; /* where a step takes u of two samples, that of the first */
    int begun;           /* whether there is a first sample */
    int measured;        /* the input of this name */
    int given;           /* whether a parameter xhat0_ was set */
    int phase;
} Known;

typedef struct {
    Known now;
    const fmi2CallbackFunctions *calls;
    char *name;
} Instance;

static void *reserved(const fmi2CallbackFunctions *calls, size_t size)
{
    return calls && calls->allocateMemory ? calls->allocateMemory(1, size) : calloc(1, size);
}

static void released(const fmi2CallbackFunctions *calls, void *memory)
{
    if (calls && calls->freeMemory) calls->freeMemory(memory);
    else free(memory);
}

/* Say why something is refused. */
static fmi2Status refused(const Instance *one, const char *message)
{
    if (one && one->calls && one->calls->logger)
        one->calls->logger(one->calls->environment, one->name, fmi2Error, "logStatusError", message);
    return fmi2Error;
}

static fmi2Status failed(const Instance *one, int code)
{
    return refused(one, code == 1 ? "an input is not finite; nothing is changed"
                                  : "an equation has no finite value, or a loop does not converge; nothing is changed");
}

/* The start: where the spec begins, or at the parameters. */
static int started(Known *now)
{
    OBS(real) xhat0[] = START;
    int i;
    for (i = 0; i < PARAMETERS; i++) xhat0[PLACES[i]] = now->v[XHAT0 + i];
    now->begun = 0;
    return OBS(init)(&now->s, now->given ? xhat0 : NULL);
}

static int reset(Known *now)
{
    const OBS(real) xhat0[] = START;
    int i;
    memset(now, 0, sizeof *now);
    for (i = 0; i < PARAMETERS; i++) now->v[XHAT0 + i] = xhat0[PLACES[i]];
    return started(now);
}

/* One period from t, or a part of it; and a measurement before it. They change nothing where they fail. */
static int advanced(Known *now, double t)
{
    int code;
#if AHEAD
    Known next = *now;
    OBS(real) both[2*OBS(NU) + 1];
    memcpy(both, now->u, OBS(NU)*sizeof *both);
    memcpy(both + OBS(NU), now->v, OBS(NU)*sizeof *both);
    code = now->begun ? OBS(step)(&next.s, t - OBS(PERIOD), both, now->v + Y) : 0;
    if (!code) code = OBS(estimate)(&next.s, t, now->v, now->v + Y, next.v + HAT);
    if (code) return code;
    memcpy(next.u, now->v, OBS(NU)*sizeof *both);
    next.begun = 1;
    *now = next;
#else
    code = OBS(step)(&now->s, t, now->v, now->v + Y);
#endif
    return code;
}

#if INSTANTS
static int flowed(Known *now, double t, double dt) { return OBS(flow)(&now->s, t, dt, now->v); }
static int jumped(Known *now, double t) { return OBS(jump)(&now->s, t, now->v, now->v + Y); }
#else
static int flowed(Known *now, double t, double dt) { (void)now; (void)t; (void)dt; return 0; }
static int jumped(Known *now, double t) { (void)now; (void)t; return 0; }
#endif

EXPORT const char *F(fmi2GetTypesPlatform)(void) { return "default"; }
EXPORT const char *F(fmi2GetVersion)(void) { return "2.0"; }

EXPORT void *F(fmi2Instantiate)(const char *name, fmi2Type type, const char *guid, const char *location,
                                const fmi2CallbackFunctions *calls, int visible, int logging)
{
    Instance *one = reserved(calls, sizeof *one);
    (void)location; (void)visible; (void)logging;
    if (!one) return NULL;
    one->calls = calls;
    one->name = name ? reserved(calls, strlen(name) + 1) : NULL;
    if (one->name) strcpy(one->name, name);
    if (!one->name || type != fmi2CoSimulation || !guid || strcmp(guid, GUID)) {
        refused(one, "this is for co-simulation, under a name, with the guid of its description");
        if (one->name) released(calls, one->name);
        released(calls, one);
        return NULL;
    }
    reset(&one->now);
    return one;
}

EXPORT void F(fmi2FreeInstance)(void *c)
{
    Instance *one = c;
    const fmi2CallbackFunctions *calls = one ? one->calls : NULL;
    if (!one) return;
    released(calls, one->name);
    released(calls, one);
}

EXPORT fmi2Status F(fmi2SetDebugLogging)(void *c, int on, size_t count, const char *const categories[])
{
    (void)on; (void)count; (void)categories;
    return c ? fmi2OK : fmi2Error;
}

EXPORT fmi2Status F(fmi2SetupExperiment)(void *c, int tolerant, double tolerance, double start, int stops, double stop)
{
    Instance *one = c;
    (void)tolerant; (void)tolerance; (void)stops; (void)stop;
    if (!one || one->now.phase != INSTANTIATED) return refused(one, "a start comes first");
    one->now.t = start;
    return fmi2OK;
}

EXPORT fmi2Status F(fmi2EnterInitializationMode)(void *c)
{
    Instance *one = c;
    if (!one || one->now.phase != INSTANTIATED) return refused(one, "it is initialized once");
    one->now.phase = INITIALIZING;
    return started(&one->now) ? refused(one, "xhat0 is not finite") : fmi2OK;
}

EXPORT fmi2Status F(fmi2ExitInitializationMode)(void *c)
{
    Instance *one = c;
    if (!one || one->now.phase != INITIALIZING) return refused(one, "it is not being initialized");
    one->now.phase = STEPPING;
    return started(&one->now) ? refused(one, "xhat0 is not finite") : fmi2OK;
}

EXPORT fmi2Status F(fmi2Terminate)(void *c)
{
    Instance *one = c;
    if (!one || one->now.phase != STEPPING) return refused(one, "it does not run");
    one->now.phase = TERMINATED;
    return fmi2OK;
}

EXPORT fmi2Status F(fmi2Reset)(void *c)
{
    Instance *one = c;
    if (!one) return fmi2Error;
    reset(&one->now);
    return fmi2OK;
}

/* Estimates are those of u and y as they are set now; where an estimate knows y of its sample, of the last sample. */
EXPORT fmi2Status F(fmi2GetReal)(void *c, const unsigned vr[], size_t n, double values[])
{
    Instance *one = c;
    OBS(real) hat[OBS(NE)];
    size_t i;
    int known = 0;
    if (!one || (n && (!vr || !values))) return refused(one, "a pointer is null");
    for (i = 0; i < n; i++) {
        if (vr[i] >= ALL) return refused(one, "there is no such variable");
        if (vr[i] >= HAT && vr[i] < XHAT0 && !known) {
            const Known *now = &one->now;
            const int code = AHEAD && now->begun ? 0 : OBS(estimate)(&now->s, now->t, now->v, now->v + Y, hat);
            if (code) return failed(one, code);
            if (AHEAD && now->begun) memcpy(hat, now->v + HAT, sizeof hat);
            known = 1;
        }
        values[i] = vr[i] >= HAT && vr[i] < XHAT0 ? hat[vr[i] - HAT] : one->now.v[vr[i]];
    }
    return fmi2OK;
}

EXPORT fmi2Status F(fmi2SetReal)(void *c, const unsigned vr[], size_t n, const double values[])
{
    Instance *one = c;
    size_t i;
    if (!one || (n && (!vr || !values))) return refused(one, "a pointer is null");
    for (i = 0; i < n; i++) {
        if (vr[i] >= ALL || (vr[i] >= HAT && vr[i] < XHAT0)) return refused(one, "this variable cannot be set");
        if (vr[i] >= XHAT0 && one->now.phase >= STEPPING) return refused(one, "xhat0 is set before the start");
        one->now.v[vr[i]] = (OBS(real))values[i];
        if (vr[i] >= XHAT0) one->now.given = 1;
    }
    if (one->now.phase == INITIALIZING) started(&one->now);
    return fmi2OK;
}

EXPORT fmi2Status F(fmi2GetBoolean)(void *c, const unsigned vr[], size_t n, int values[])
{
    Instance *one = c;
    size_t i;
    if (!one || (n && (!INSTANTS || !vr || !values))) return refused(one, "there is no such variable");
    for (i = 0; i < n; i++) {
        if (vr[i]) return refused(one, "there is no such variable");
        values[i] = one->now.measured;
    }
    return fmi2OK;
}

EXPORT fmi2Status F(fmi2SetBoolean)(void *c, const unsigned vr[], size_t n, const int values[])
{
    Instance *one = c;
    size_t i;
    if (!one || (n && (!INSTANTS || !vr || !values))) return refused(one, "there is no such variable");
    for (i = 0; i < n; i++) {
        if (vr[i]) return refused(one, "there is no such variable");
        one->now.measured = values[i];
    }
    return fmi2OK;
}

/* A step over whole periods; where y is known at instants, over any time. */
EXPORT fmi2Status F(fmi2DoStep)(void *c, double t, double h, int final)
{
    Instance *one = c;
    const double period = OBS(PERIOD), whole = floor(h/period + 1e-6);
    double k, rest = h - whole*period;
    Known next;
    int code = 0;
    (void)final;
    if (!one || one->now.phase != STEPPING) return refused(one, "it is not initialized");
    if (!(h > 0 && h <= 1e9*period) || (!INSTANTS && !(whole >= 1 && rest <= 1e-6*period))) {
        char message[120];
        snprintf(message, sizeof message, "a step of %.9g s; take %s of %.9g s, the period of the observer", h,
                 INSTANTS ? "one > 0, up to a billion times that" : "a multiple", period);
        return refused(one, message);
    }
    next = one->now;
    if (next.measured) code = jumped(&next, t);
    next.measured = 0; /* it is taken once */
    for (k = 0; k < whole && !code; k++) code = advanced(&next, t + k*period);
    if (rest > 1e-9*period && INSTANTS && !code) code = flowed(&next, t + whole*period, rest);
    if (code) return failed(one, code);
    next.t = t + h;
    one->now = next;
    return fmi2OK;
}

EXPORT fmi2Status F(fmi2GetFMUstate)(void *c, void **state)
{
    Instance *one = c;
    if (!one || !state) return refused(one, "a pointer is null");
    if (!*state) *state = reserved(one->calls, sizeof(Known));
    if (!*state) return refused(one, "there is no memory");
    memcpy(*state, &one->now, sizeof(Known));
    return fmi2OK;
}

EXPORT fmi2Status F(fmi2SetFMUstate)(void *c, void *state)
{
    Instance *one = c;
    if (!one || !state) return refused(one, "a pointer is null");
    memcpy(&one->now, state, sizeof(Known));
    return fmi2OK;
}

EXPORT fmi2Status F(fmi2FreeFMUstate)(void *c, void **state)
{
    Instance *one = c;
    if (!one || !state) return refused(one, "a pointer is null");
    if (*state) released(one->calls, *state);
    *state = NULL;
    return fmi2OK;
}

EXPORT fmi2Status F(fmi2SerializedFMUstateSize)(void *c, void *state, size_t *size)
{
    if (!c || !state || !size) return refused(c, "a pointer is null");
    *size = sizeof(Known);
    return fmi2OK;
}

EXPORT fmi2Status F(fmi2SerializeFMUstate)(void *c, void *state, char bytes[], size_t size)
{
    if (!c || !state || !bytes || size < sizeof(Known)) return refused(c, "a pointer is null, or a size too small");
    memcpy(bytes, state, sizeof(Known));
    return fmi2OK;
}

EXPORT fmi2Status F(fmi2DeSerializeFMUstate)(void *c, const char bytes[], size_t size, void **state)
{
    Instance *one = c;
    if (!one || !bytes || !state || size != sizeof(Known)) return refused(one, "these are not the bytes of a state");
    if (!*state) *state = reserved(one->calls, sizeof(Known));
    if (!*state) return refused(one, "there is no memory");
    memcpy(*state, bytes, sizeof(Known));
    return fmi2OK;
}

/* What this FMU has nothing of: whole numbers, texts, derivatives, steps that are not done when they return. */
EXPORT fmi2Status F(fmi2GetInteger)(void *c, const unsigned vr[], size_t n, int values[])
{
    (void)vr; (void)values;
    return n ? refused(c, "there is no such variable") : fmi2OK;
}

EXPORT fmi2Status F(fmi2SetInteger)(void *c, const unsigned vr[], size_t n, const int values[])
{
    (void)vr; (void)values;
    return n ? refused(c, "there is no such variable") : fmi2OK;
}

EXPORT fmi2Status F(fmi2GetString)(void *c, const unsigned vr[], size_t n, const char *values[])
{
    (void)vr; (void)values;
    return n ? refused(c, "there is no such variable") : fmi2OK;
}

EXPORT fmi2Status F(fmi2SetString)(void *c, const unsigned vr[], size_t n, const char *const values[])
{
    (void)vr; (void)values;
    return n ? refused(c, "there is no such variable") : fmi2OK;
}

EXPORT fmi2Status F(fmi2GetDirectionalDerivative)(void *c, const unsigned of[], size_t n, const unsigned by[],
                                                  size_t m, const double known[], double found[])
{
    (void)of; (void)n; (void)by; (void)m; (void)known; (void)found;
    return refused(c, "there are no derivatives");
}

EXPORT fmi2Status F(fmi2SetRealInputDerivatives)(void *c, const unsigned vr[], size_t n, const int orders[],
                                                 const double values[])
{
    (void)vr; (void)orders; (void)values;
    return n ? refused(c, "inputs are held over a step") : fmi2OK;
}

EXPORT fmi2Status F(fmi2GetRealOutputDerivatives)(void *c, const unsigned vr[], size_t n, const int orders[],
                                                  double values[])
{
    (void)vr; (void)orders; (void)values;
    return n ? refused(c, "there are no derivatives") : fmi2OK;
}

EXPORT fmi2Status F(fmi2CancelStep)(void *c) { return refused(c, "no step is under way"); }

EXPORT fmi2Status F(fmi2GetStatus)(void *c, fmi2StatusKind kind, fmi2Status *value)
{
    (void)c; (void)kind; (void)value;
    return fmi2Discard;
}

EXPORT fmi2Status F(fmi2GetRealStatus)(void *c, fmi2StatusKind kind, double *value)
{
    Instance *one = c;
    if (!one || !value || kind != fmi2LastSuccessfulTime) return fmi2Discard;
    *value = one->now.t;
    return fmi2OK;
}

EXPORT fmi2Status F(fmi2GetIntegerStatus)(void *c, fmi2StatusKind kind, int *value)
{
    (void)c; (void)kind; (void)value;
    return fmi2Discard;
}

EXPORT fmi2Status F(fmi2GetBooleanStatus)(void *c, fmi2StatusKind kind, int *value)
{
    if (!c || !value || kind != fmi2Terminated) return fmi2Discard;
    *value = 0;
    return fmi2OK;
}

EXPORT fmi2Status F(fmi2GetStringStatus)(void *c, fmi2StatusKind kind, const char **value)
{
    (void)c; (void)kind; (void)value;
    return fmi2Discard;
}
