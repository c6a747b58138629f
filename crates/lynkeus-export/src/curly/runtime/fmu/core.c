/* Value references: time, the signals, the estimates, the starts, then what may be changed. */
enum {
    SIGNALS = @CAPITALS@_SIGNALS,
    SENSORS = @SENSORS@,
    ESTIMATES = @CAPITALS@_ESTIMATES,
    STARTS = @STARTS@,
    FIRST_SIGNAL = 1,
    FIRST_ESTIMATE = FIRST_SIGNAL + SIGNALS,
    FIRST_START = FIRST_ESTIMATE + ESTIMATES,
//? tunable
    TUNABLES = @CAPITALS@_TUNABLES,
    FIRST_TUNABLE = FIRST_START + STARTS,
    VALUES = FIRST_TUNABLE + TUNABLES
//?
//? !tunable
    VALUES = FIRST_START + STARTS
//?
};

/* Before inputs are given. */
static const @REAL@ first_signals[SIGNALS] = {@FIRST_SIGNALS@};

/* All that changes: a copy is a state of the FMU. */
typedef struct {
    @NAME@_state past;         /* with every sample before the communication point */
    @NAME@_state now;          /* with that of the communication point, once it is settled */
    double time;               /* the communication point */
    double starts[STARTS];
//? tunable
    double tuning[TUNABLES];   /* from the communication point on */
//?
    @REAL@ signals[SIGNALS];
    @REAL@ estimates[ESTIMATES];
    int is_given;              /* whether inputs have been given at this point */
    int is_settled;            /* whether `now` and `estimates` hold */
    int mode;                  /* one of the modes above */
} course;

static void begin(course *c)
{
    memset(c, 0, sizeof *c);
    c->mode = INSTANTIATED;
    @NAME@_init(&c->past);
    c->now = c->past;
    for (int i = 0; i < SIGNALS; i++) {
        c->signals[i] = first_signals[i];
    }
    for (int i = 0; i < STARTS; i++) {
        c->starts[i] = (double)c->past.x[i];
    }
//? tunable
    for (int i = 0; i < TUNABLES; i++) {
        c->tuning[i] = (double)c->past.tuning[i];
    }
//?
    c->is_given = 1;
}

/* The inputs at a communication point are a sample of that time. Until they are given, after a
   step, the estimates are the prediction: no sensor has reported yet. */
static int settle(course *c)
{
    @REAL@ sample[SIGNALS];
    int code = 0;
    if (c->is_settled) {
        return 0;
    }
    for (int i = 0; i < SIGNALS; i++) {
        sample[i] = (c->is_given || i >= SENSORS) ? c->signals[i] : (@REAL@)NAN;
    }
    c->now = c->past;
    code = @NAME@_push(&c->now, c->time, sample, c->estimates);
    c->is_settled = code == 0;
    return code;
}

/* What a refused sample leaves: the state before it, which counts that, or begins anew. */
static void give_up(course *c, const course *before)
{
    const @NAME@_state left = c->now;
    *c = *before;
    c->past = left;
}

/* Takes the sample of the communication point, and goes to the next, of which the estimates then
   are a prediction. */
static int step(course *c, double from, double to)
{
    const course before = *c;
    int code = 0;
    /* inputs that are not given again have stayed */
    if (from < c->time || from > c->time || !c->is_given) {
        c->time = from;
        c->is_given = 1;
        c->is_settled = 0;
    }
    code = settle(c);
    if (code != 0) {
        give_up(c, &before);
        return code;
    }
    c->past = c->now;
//? tunable
    for (int i = 0; i < TUNABLES; i++) {
        c->past.tuning[i] = (@REAL@)c->tuning[i];
    }
//?
    c->time = to;
    c->is_given = 0;
    c->is_settled = 0;
    /* the way to the next point belongs to this step: where there is none, nothing has changed */
    code = settle(c);
    if (code != 0) {
        *c = before;
    }
    return code;
}

static int read_value(course *c, uint32_t reference, double *value)
{
    if (reference >= VALUES) {
        return NO_VALUE;
    }
//? tunable
    if (reference >= FIRST_TUNABLE) {
        *value = c->tuning[reference - FIRST_TUNABLE];
        return 0;
    }
//?
    if (reference >= FIRST_START) {
        *value = c->starts[reference - FIRST_START];
    } else if (reference >= FIRST_ESTIMATE) {
        const int code = settle(c);
        if (code != 0) {
            return code;
        }
        *value = (double)c->estimates[reference - FIRST_ESTIMATE];
    } else if (reference >= FIRST_SIGNAL) {
        *value = (double)c->signals[reference - FIRST_SIGNAL];
    } else {
        *value = c->time;
    }
    return 0;
}

/* Why a value cannot be set now, or 0. */
static int refusal(const course *c, uint32_t reference, double value)
{
    if (reference >= VALUES) {
        return NO_VALUE;
    }
//? tunable
    if (reference >= FIRST_TUNABLE) {
        return (@REAL@)value > 0 && isfinite((@REAL@)value) ? 0 : NOT_POSITIVE;
    }
//?
//? !tunable
    (void)value;
//?
    if (reference >= FIRST_START) {
        return (c->mode & BEFORE) == 0 ? NOT_NOW : 0;
    }
    return reference >= FIRST_SIGNAL && reference < FIRST_ESTIMATE ? 0 : NOT_SETTABLE;
}

static void write_value(course *c, uint32_t reference, double value)
{
//? tunable
    if (reference >= FIRST_TUNABLE) {
        c->tuning[reference - FIRST_TUNABLE] = value;
        return;
    }
//?
    if (reference >= FIRST_START) {
        c->starts[reference - FIRST_START] = value;
        c->past.x[reference - FIRST_START] = (@REAL@)value;
    } else {
        c->signals[reference - FIRST_SIGNAL] = (@REAL@)value;
        c->is_given = 1;
    }
    c->is_settled = 0;
}
