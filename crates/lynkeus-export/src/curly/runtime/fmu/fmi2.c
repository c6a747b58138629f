/* What is needed of the headers of FMI 2.0, https://fmi-standard.org. */
typedef enum { fmi2OK, fmi2Warning, fmi2Discard, fmi2Error, fmi2Fatal, fmi2Pending } fmi2Status;
typedef enum { fmi2ModelExchange, fmi2CoSimulation } fmi2Type;
typedef enum { fmi2DoStepStatus, fmi2PendingStatus, fmi2LastSuccessfulTime, fmi2Terminated } fmi2StatusKind;
typedef const char *fmi2String;
typedef int fmi2Boolean;
typedef void (*logger)(
    void *environment, fmi2String name, fmi2Status status, fmi2String category, fmi2String message, ...);

typedef struct {
    logger log;
    void *(*allocate)(size_t count, size_t size);
    void (*release)(void *place);
    void (*finished)(void *environment, fmi2Status status);
    void *environment;
} callbacks;

typedef struct {
    course at;
    const callbacks *calls;
    char *name;     /* of the instance */
//? exchange
    int is_logging;  /* tells what is no error, too */
    int is_exchange; /* the tool integrates */
//?
} component;

static fmi2Status told(component *m, int code)
{
    fmi2Status status = fmi2Error;
    const char *category = "logStatusError";
    int is_told = m != NULL && m->calls != NULL && m->calls->log != NULL;
    if (code == 0) {
        return fmi2OK;
    }
//? exchange
    /* a shorter step may stay where the equations have values; this is told where it is asked for */
    if (code == @CAPITALS@_NOT_FINITE) {
        status = fmi2Discard;
        category = "logStatusDiscard";
        is_told = is_told && m->is_logging;
    }
//?
    if (is_told) {
        m->calls->log(m->calls->environment, m->name, status, category, "%s", reason(code));
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
    API fmi2Status FULL(fmi2##NAME)(void *instance) \
    {                                               \
        OPEN(FROM)                                  \
        m->at.mode = TO;                            \
        return fmi2OK;                              \
    }

API const char *FULL(fmi2GetTypesPlatform)(void)
{
    return "default";
}

API const char *FULL(fmi2GetVersion)(void)
{
    return "2.0";
}

API fmi2Status FULL(fmi2SetDebugLogging)(void *instance, fmi2Boolean on, size_t count, const fmi2String *categories)
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
    return fmi2OK;
}

API void *FULL(fmi2Instantiate)(
    fmi2String name, fmi2Type type, fmi2String given, fmi2String resources, const callbacks *calls,
    fmi2Boolean visible, fmi2Boolean logging)
{
    component *m = NULL;
    const size_t length = name == NULL ? 0 : strlen(name);
    (void)resources, (void)visible;
//? exchange
    const int is_offered = type == fmi2CoSimulation || type == fmi2ModelExchange;
    const char *const expected = "expected the GUID of this FMU";
//?
//? !exchange
    (void)logging;
    const int is_offered = type == fmi2CoSimulation;
    const char *const expected = "expected co-simulation, and the GUID of this FMU";
//?
    if (!is_offered || !is_ours(given)) {
        if (calls != NULL && calls->log != NULL) {
            calls->log(calls->environment, name, fmi2Error, "logStatusError", "%s", expected);
        }
        return NULL;
    }
    m = calloc(1, sizeof *m + length + 1);
    if (m != NULL) {
        /* behind the component, and zero at its end */
        m->name = (char *)(m + 1);
        memcpy(m->name, length == 0 ? "" : name, length);
        m->calls = calls;
//? exchange
        m->is_logging = logging;
        m->is_exchange = type == fmi2ModelExchange;
//?
        begin(&m->at);
    }
    return m;
}

API void FULL(fmi2FreeInstance)(void *instance)
{
    free(instance);
}

API fmi2Status FULL(fmi2SetupExperiment)(
    void *instance, fmi2Boolean has_tolerance, double tolerance, double start, fmi2Boolean has_stop, double stop)
{
    OPEN(INSTANTIATED)
    (void)has_tolerance, (void)tolerance, (void)has_stop, (void)stop;
    m->at.time = start;
    m->at.is_settled = 0;
    return fmi2OK;
}

MODE(EnterInitializationMode, INSTANTIATED, INITIALIZATION)
MODE(ExitInitializationMode, INITIALIZATION, RUNNING)
MODE(Terminate, INITIALIZATION | RUNNING, TERMINATED)

API fmi2Status FULL(fmi2Reset)(void *instance)
{
    OPEN(ANY)
    begin(&m->at);
    return fmi2OK;
}

API fmi2Status FULL(fmi2GetReal)(void *instance, const unsigned *references, size_t count, double *values)
{
    OPEN(ANY)
    int code = 0;
    for (size_t i = 0; i < count && code == 0; i++) {
        code = read_value(&m->at, references[i], &values[i]);
    }
    return told(m, code);
}

API fmi2Status FULL(fmi2SetReal)(void *instance, const unsigned *references, size_t count, const double *values)
{
    OPEN(BEFORE | RUNNING)
    return told(m, write_values(&m->at, references, count, values));
}

API fmi2Status FULL(fmi2DoStep)(void *instance, double from, double length, fmi2Boolean is_past_fixed)
{
    OPEN(RUNNING)
//? exchange
    ONLY(!m->is_exchange)
//?
    (void)is_past_fixed;
    return told(m, step(&m->at, from, from + length));
}

API fmi2Status FULL(fmi2GetFMUstate)(void *instance, void **kept)
{
    OPEN(ANY)
    return told(m, keep(&m->at, kept));
}

API fmi2Status FULL(fmi2SetFMUstate)(void *instance, void *kept)
{
    OPEN(ANY)
    return told(m, restored(&m->at, kept));
}

API fmi2Status FULL(fmi2FreeFMUstate)(void *instance, void **kept)
{
    (void)instance;
    if (kept != NULL) {
        free(*kept);
        *kept = NULL;
    }
    return fmi2OK;
}

API fmi2Status FULL(fmi2SerializedFMUstateSize)(void *instance, void *kept, size_t *size)
{
    (void)kept;
    return told(instance, measured(size));
}

API fmi2Status FULL(fmi2SerializeFMUstate)(void *instance, void *kept, char *bytes, size_t size)
{
    return told(instance, written(kept, bytes, size));
}

API fmi2Status FULL(fmi2DeSerializeFMUstate)(void *instance, const char *bytes, size_t size, void **kept)
{
    return told(instance, taken(bytes, size, kept));
}

API fmi2Status FULL(fmi2GetRealStatus)(void *instance, fmi2StatusKind kind, double *value)
{
    OPEN(ANY)
    if (kind != fmi2LastSuccessfulTime) {
        return fmi2Discard;
    }
    *value = m->at.time;
    return fmi2OK;
}

API fmi2Status FULL(fmi2GetBooleanStatus)(void *instance, fmi2StatusKind kind, fmi2Boolean *value)
{
    (void)instance;
    *value = 0;
    return kind == fmi2Terminated ? fmi2OK : fmi2Discard;
}

/* What this FMU has not, but must answer. */
static fmi2Status absent(void *instance, size_t count)
{
    return told(instance, count == 0 ? 0 : NO_VALUE);
}

#define NO_VALUES(NAME, KIND)                                                                                  \
    API fmi2Status FULL(fmi2Get##NAME)(void *instance, const unsigned *references, size_t count, KIND *values) \
    {                                                                                                          \
        (void)references, (void)values;                                                                        \
        return absent(instance, count);                                                                        \
    }                                                                                                          \
    API fmi2Status FULL(fmi2Set##NAME)(                                                                        \
        void *instance, const unsigned *references, size_t count, const KIND *values)                          \
    {                                                                                                          \
        (void)references, (void)values;                                                                        \
        return absent(instance, count);                                                                        \
    }

NO_VALUES(Integer, int)
NO_VALUES(Boolean, fmi2Boolean)
NO_VALUES(String, fmi2String)

#define NO_STATUS(NAME, KIND)                                                                    \
    API fmi2Status FULL(fmi2Get##NAME##Status)(void *instance, fmi2StatusKind kind, KIND *value) \
    {                                                                                            \
        (void)instance, (void)kind, (void)value;                                                 \
        return fmi2Discard;                                                                      \
    }

NO_STATUS(Integer, int)
NO_STATUS(String, fmi2String)

API fmi2Status FULL(fmi2GetStatus)(void *instance, fmi2StatusKind kind, fmi2Status *value)
{
    (void)instance, (void)kind, (void)value;
    return fmi2Discard;
}

API fmi2Status FULL(fmi2CancelStep)(void *instance)
{
    return told(instance, NOT_NOW);
}

API fmi2Status FULL(fmi2SetRealInputDerivatives)(
    void *instance, const unsigned *references, size_t count, const int *orders, const double *values)
{
    (void)references, (void)orders, (void)values;
    return absent(instance, count);
}

API fmi2Status FULL(fmi2GetRealOutputDerivatives)(
    void *instance, const unsigned *references, size_t count, const int *orders, double *values)
{
    (void)references, (void)orders, (void)values;
    return absent(instance, count);
}
//? !exchange

API fmi2Status FULL(fmi2GetDirectionalDerivative)(
    void *instance, const unsigned *unknowns, size_t unknown_count, const unsigned *knowns, size_t known_count,
    const double *seed, double *result)
{
    (void)unknowns, (void)unknown_count, (void)knowns, (void)known_count, (void)seed, (void)result;
    return told(instance, NOT_NOW);
}
//?
