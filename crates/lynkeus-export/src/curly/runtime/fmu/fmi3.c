/* What is needed of the headers of FMI 3.0, https://fmi-standard.org. */
typedef enum { fmi3OK, fmi3Warning, fmi3Discard, fmi3Error, fmi3Fatal } fmi3Status;
typedef const char *fmi3String;
typedef const uint8_t *fmi3Binary;
typedef void (*logger)(void *environment, fmi3Status status, fmi3String category, fmi3String message);

typedef struct {
    course at;
    void *environment;
    logger log;
//? exchange
    bool is_logging;  /* tells what is no error, too */
    bool is_exchange; /* the tool integrates */
//?
} component;

static fmi3Status told(component *m, int code)
{
    fmi3Status status = fmi3Error;
    const char *category = "logStatusError";
    int is_told = m != NULL && m->log != NULL;
    if (code == 0) {
        return fmi3OK;
    }
//? exchange
    /* a shorter step may stay where the equations have values; this is told where it is asked for */
    if (code == @CAPITALS@_NOT_FINITE) {
        status = fmi3Discard;
        category = "logStatusDiscard";
        is_told = is_told && m->is_logging;
    }
//?
    if (is_told) {
        m->log(m->environment, status, category, reason(code));
    }
    return status;
}

/* The instance, which must be in one of these modes. */
#define OPEN(MODES)                                 \
    component *m = instance;                        \
    if (m == NULL || (m->at.mode & (MODES)) == 0) { \
        return told(m, NOT_NOW);                    \
    }

//? exchange
/* What only one of the two interfaces has. */
#define ONLY(IS_SO)              \
    if (!(IS_SO)) {              \
        return told(m, NOT_NOW); \
    }

//?
#define MODE(NAME, FROM, TO)                        \
    API fmi3Status FULL(fmi3##NAME)(void *instance) \
    {                                               \
        OPEN(FROM)                                  \
        m->at.mode = TO;                            \
        return fmi3OK;                              \
    }

API const char *FULL(fmi3GetVersion)(void)
{
    return "3.0";
}

API fmi3Status FULL(fmi3SetDebugLogging)(void *instance, bool on, size_t count, const fmi3String *categories)
{
    OPEN(ANY)
//? exchange
    if (has_discards(count, categories)) {
        m->is_logging = on;
    }
//?
//? !exchange
    (void)on, (void)count, (void)categories;
//?
    return fmi3OK;
}

static void *made(fmi3String given, bool is_exchange, bool logging, void *environment, logger log)
{
    component *m = NULL;
//? !exchange
    (void)is_exchange, (void)logging;
//?
    if (!is_ours(given)) {
        if (log != NULL) {
            log(environment, fmi3Error, "logStatusError", "the instantiation token is that of another FMU");
        }
        return NULL;
    }
    m = calloc(1, sizeof *m);
    if (m != NULL) {
        m->environment = environment;
        m->log = log;
//? exchange
        m->is_logging = logging;
        m->is_exchange = is_exchange;
//?
        begin(&m->at);
    }
    return m;
}

API void *FULL(fmi3InstantiateCoSimulation)(
    fmi3String name, fmi3String given, fmi3String resources, bool visible, bool logging, bool events,
    bool early, const uint32_t *required, size_t count, void *environment, logger log, void (*update)(void))
{
    (void)name, (void)resources, (void)visible, (void)events, (void)early;
    (void)required, (void)count, (void)update;
    return made(given, false, logging, environment, log);
}

API void *FULL(fmi3InstantiateModelExchange)(
    fmi3String name, fmi3String given, fmi3String resources, bool visible, bool logging, void *environment,
    logger log)
{
    (void)name, (void)resources, (void)visible;
//? exchange
    return made(given, true, logging, environment, log);
//?
//? !exchange
    (void)given, (void)logging, (void)environment, (void)log;
    return NULL;
//?
}

API void *FULL(fmi3InstantiateScheduledExecution)(
    fmi3String name, fmi3String given, fmi3String resources, bool visible, bool logging, void *environment,
    logger log, void (*update)(void), void (*lock)(void), void (*unlock)(void))
{
    (void)name, (void)given, (void)resources, (void)visible, (void)logging, (void)environment, (void)log;
    (void)update, (void)lock, (void)unlock;
    return NULL;
}

API void FULL(fmi3FreeInstance)(void *instance)
{
    free(instance);
}

API fmi3Status FULL(fmi3EnterInitializationMode)(
    void *instance, bool has_tolerance, double tolerance, double start, bool has_stop, double stop)
{
    OPEN(INSTANTIATED)
    (void)has_tolerance, (void)tolerance, (void)has_stop, (void)stop;
    m->at.mode = INITIALIZATION;
    m->at.time = start;
    m->at.is_settled = 0;
    return fmi3OK;
}

MODE(ExitInitializationMode, INITIALIZATION, RUNNING)
MODE(EnterEventMode, RUNNING, RUNNING)
MODE(EnterStepMode, RUNNING, RUNNING)
MODE(Terminate, INITIALIZATION | RUNNING, TERMINATED)

API fmi3Status FULL(fmi3Reset)(void *instance)
{
    OPEN(ANY)
    begin(&m->at);
    return fmi3OK;
}

API fmi3Status FULL(fmi3GetFloat64)(
    void *instance, const uint32_t *references, size_t count, double *values, size_t size)
{
    OPEN(ANY)
    int code = count == size ? 0 : NO_VALUE;
    for (size_t i = 0; i < count && code == 0; i++) {
        code = read_value(&m->at, references[i], &values[i]);
    }
    return told(m, code);
}

API fmi3Status FULL(fmi3SetFloat64)(
    void *instance, const uint32_t *references, size_t count, const double *values, size_t size)
{
    OPEN(BEFORE | RUNNING)
    return told(m, count == size ? write_values(&m->at, references, count, values) : NO_VALUE);
}

API fmi3Status FULL(fmi3DoStep)(
    void *instance, double from, double length, bool is_past_fixed, bool *has_event, bool *is_over,
    bool *is_early, double *reached)
{
    OPEN(RUNNING)
//? exchange
    ONLY(!m->is_exchange)
//?
    const int code = step(&m->at, from, from + length);
    (void)is_past_fixed;
    *has_event = false;
    *is_over = false;
    *is_early = false;
    *reached = m->at.time;
    return told(m, code);
}

API fmi3Status FULL(fmi3GetFMUState)(void *instance, void **kept)
{
    OPEN(ANY)
    return told(m, keep(&m->at, kept));
}

API fmi3Status FULL(fmi3SetFMUState)(void *instance, void *kept)
{
    OPEN(ANY)
    return told(m, restored(&m->at, kept));
}

API fmi3Status FULL(fmi3FreeFMUState)(void *instance, void **kept)
{
    (void)instance;
    if (kept != NULL) {
        free(*kept);
        *kept = NULL;
    }
    return fmi3OK;
}

API fmi3Status FULL(fmi3SerializedFMUStateSize)(void *instance, void *kept, size_t *size)
{
    (void)kept;
    return told(instance, measured(size));
}

API fmi3Status FULL(fmi3SerializeFMUState)(void *instance, void *kept, uint8_t *bytes, size_t size)
{
    return told(instance, written(kept, bytes, size));
}

API fmi3Status FULL(fmi3DeserializeFMUState)(void *instance, const uint8_t *bytes, size_t size, void **kept)
{
    return told(instance, taken(bytes, size, kept));
}

/* Outputs follow what is set at once. */
API fmi3Status FULL(fmi3UpdateDiscreteStates)(
    void *instance, bool *is_unfinished, bool *is_over, bool *has_nominals, bool *has_values, bool *has_next,
    double *next)
{
    OPEN(RUNNING)
//? !events
    (void)next;
//?
    *is_unfinished = false;
    *is_over = false;
    *has_nominals = false;
    *has_values = false;
    *has_next = false;
//? events
    if (m->is_exchange) {
        int is_changed = 0;
        int is_timed = 0;
        const int code = react(&m->at, &is_changed, &is_timed, next);
        *has_values = is_changed != 0;
        *has_next = is_timed != 0;
        return told(m, code);
    }
//?
    return fmi3OK;
}

API fmi3Status FULL(fmi3EvaluateDiscreteStates)(void *instance)
{
    OPEN(INITIALIZATION | RUNNING)
    return fmi3OK;
}
