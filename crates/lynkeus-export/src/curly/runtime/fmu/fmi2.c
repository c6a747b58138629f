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
    char *name; /* of the instance */
} component;

static fmi2Status told(component *m, int code)
{
//? exchange
    /* a shorter step may stay where the equations have values */
    const fmi2Status status = code == @CAPITALS@_NOT_FINITE ? fmi2Discard : fmi2Error;
//?
//? !exchange
    const fmi2Status status = fmi2Error;
//?
    if (code == 0) {
        return fmi2OK;
    }
    if (m->calls != NULL && m->calls->log != NULL) {
        m->calls->log(m->calls->environment, m->name, status, "logStatusError", "%s", reason(code));
    }
    return status;
}

API const char *fmi2GetTypesPlatform(void)
{
    return "default";
}

API const char *fmi2GetVersion(void)
{
    return "2.0";
}

API fmi2Status fmi2SetDebugLogging(void *instance, fmi2Boolean on, size_t count, const fmi2String *categories)
{
    (void)instance, (void)on, (void)count, (void)categories;
    return fmi2OK;
}

API void *fmi2Instantiate(
    fmi2String name, fmi2Type type, fmi2String given, fmi2String resources, const callbacks *calls,
    fmi2Boolean visible, fmi2Boolean logging)
{
    component *m = NULL;
    const size_t length = name == NULL ? 0 : strlen(name);
    (void)resources, (void)visible, (void)logging;
//? exchange
    const int is_offered = type == fmi2CoSimulation || type == fmi2ModelExchange;
    const char *const expected = "expected the GUID of this FMU";
//?
//? !exchange
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
        begin(&m->at);
    }
    return m;
}

API void fmi2FreeInstance(void *instance)
{
    free(instance);
}

API fmi2Status fmi2SetupExperiment(
    void *instance, fmi2Boolean has_tolerance, double tolerance, double start, fmi2Boolean has_stop, double stop)
{
    component *m = instance;
    (void)has_tolerance, (void)tolerance, (void)has_stop, (void)stop;
    m->at.time = start;
    m->at.is_settled = 0;
    return fmi2OK;
}

API fmi2Status fmi2ExitInitializationMode(void *instance)
{
    component *m = instance;
    m->at.is_running = 1;
    return fmi2OK;
}

API fmi2Status fmi2Reset(void *instance)
{
    component *m = instance;
    begin(&m->at);
    return fmi2OK;
}

API fmi2Status fmi2GetReal(void *instance, const unsigned *references, size_t count, double *values)
{
    component *m = instance;
    int code = 0;
    for (size_t i = 0; i < count && code == 0; i++) {
        code = read_value(&m->at, references[i], &values[i]);
    }
    return told(m, code);
}

API fmi2Status fmi2SetReal(void *instance, const unsigned *references, size_t count, const double *values)
{
    component *m = instance;
    int code = 0;
    for (size_t i = 0; i < count && code == 0; i++) {
        code = write_value(&m->at, references[i], values[i]);
    }
    return told(m, code);
}

API fmi2Status fmi2DoStep(void *instance, double from, double length, fmi2Boolean is_past_fixed)
{
    component *m = instance;
    (void)is_past_fixed;
    return told(m, step(&m->at, from, from + length));
}

API fmi2Status fmi2GetFMUstate(void *instance, void **kept)
{
    component *m = instance;
    return told(m, keep(&m->at, kept));
}

API fmi2Status fmi2SetFMUstate(void *instance, void *kept)
{
    component *m = instance;
    memcpy(&m->at, kept, sizeof m->at);
    return fmi2OK;
}

API fmi2Status fmi2FreeFMUstate(void *instance, void **kept)
{
    (void)instance;
    free(*kept);
    *kept = NULL;
    return fmi2OK;
}

API fmi2Status fmi2SerializedFMUstateSize(void *instance, void *kept, size_t *size)
{
    (void)instance, (void)kept;
    *size = BYTES;
    return fmi2OK;
}

API fmi2Status fmi2SerializeFMUstate(void *instance, void *kept, char *bytes, size_t size)
{
    return told(instance, written(kept, bytes, size));
}

API fmi2Status fmi2DeSerializeFMUstate(void *instance, const char *bytes, size_t size, void **kept)
{
    return told(instance, taken(bytes, size, kept));
}

API fmi2Status fmi2GetRealStatus(void *instance, fmi2StatusKind kind, double *value)
{
    component *m = instance;
    if (kind != fmi2LastSuccessfulTime) {
        return fmi2Discard;
    }
    *value = m->at.time;
    return fmi2OK;
}

API fmi2Status fmi2GetBooleanStatus(void *instance, fmi2StatusKind kind, fmi2Boolean *value)
{
    (void)instance;
    *value = 0;
    return kind == fmi2Terminated ? fmi2OK : fmi2Discard;
}

#define MODE(NAME)                            \
    API fmi2Status fmi2##NAME(void *instance) \
    {                                         \
        (void)instance;                       \
        return fmi2OK;                        \
    }

MODE(EnterInitializationMode)

API fmi2Status fmi2Terminate(void *instance)
{
    component *m = instance;
    m->at.is_running = 0;
    return fmi2OK;
}

/* What this FMU has not, but must answer. */
static fmi2Status absent(void *instance, size_t count)
{
    return told(instance, count == 0 ? 0 : NO_VALUE);
}

#define NO_VALUES(NAME, KIND)                                                                             \
    API fmi2Status fmi2Get##NAME(void *instance, const unsigned *references, size_t count, KIND *values)  \
    {                                                                                                     \
        (void)references, (void)values;                                                                   \
        return absent(instance, count);                                                                   \
    }                                                                                                     \
    API fmi2Status fmi2Set##NAME(                                                                         \
        void *instance, const unsigned *references, size_t count, const KIND *values)                     \
    {                                                                                                     \
        (void)references, (void)values;                                                                   \
        return absent(instance, count);                                                                   \
    }

NO_VALUES(Integer, int)
NO_VALUES(Boolean, fmi2Boolean)
NO_VALUES(String, fmi2String)

#define NO_STATUS(NAME, KIND)                                                                   \
    API fmi2Status fmi2Get##NAME##Status(void *instance, fmi2StatusKind kind, KIND *value)      \
    {                                                                                           \
        (void)instance, (void)kind, (void)value;                                                \
        return fmi2Discard;                                                                     \
    }

NO_STATUS(Integer, int)
NO_STATUS(String, fmi2String)

API fmi2Status fmi2GetStatus(void *instance, fmi2StatusKind kind, fmi2Status *value)
{
    (void)instance, (void)kind, (void)value;
    return fmi2Discard;
}

API fmi2Status fmi2CancelStep(void *instance)
{
    return told(instance, NOT_NOW);
}

API fmi2Status fmi2SetRealInputDerivatives(
    void *instance, const unsigned *references, size_t count, const int *orders, const double *values)
{
    (void)references, (void)orders, (void)values;
    return absent(instance, count);
}

API fmi2Status fmi2GetRealOutputDerivatives(
    void *instance, const unsigned *references, size_t count, const int *orders, double *values)
{
    (void)references, (void)orders, (void)values;
    return absent(instance, count);
}
//? !exchange

API fmi2Status fmi2GetDirectionalDerivative(
    void *instance, const unsigned *unknowns, size_t unknown_count, const unsigned *knowns, size_t known_count,
    const double *seed, double *result)
{
    (void)unknowns, (void)unknown_count, (void)knowns, (void)known_count, (void)seed, (void)result;
    return told(instance, NOT_NOW);
}
//?
