/* Value references: time, the inputs, the states, their derivatives, the outputs, the parameters, what passes zero
   where a state may jump. */
enum {
    INPUTS = @CAPITALS@_INPUTS,
    PARAMETERS = @CAPITALS@_PARAMETERS,
    STATES = @CAPITALS@_STATES,
    OUTPUTS = @CAPITALS@_OUTPUTS,
    FIRST_INPUT = 1,
    FIRST_STATE = FIRST_INPUT + INPUTS,
    FIRST_DERIVATIVE = FIRST_STATE + STATES,
    FIRST_OUTPUT = FIRST_DERIVATIVE + STATES,
    FIRST_PARAMETER = FIRST_OUTPUT + OUTPUTS,
//? events
    INDICATORS = @CAPITALS@_RELATIONS,
//?
//? !events
    INDICATORS = 0,
//?
    FIRST_INDICATOR = FIRST_PARAMETER + PARAMETERS,
    VALUES = FIRST_INDICATOR + INDICATORS,
    GIVEN = INPUTS + PARAMETERS
};

/* C has no array without entries: where there may be none, there is room for one more. */
static const double first_given[GIVEN + 1] = {@FIRST_GIVEN@};
static const double nominals[STATES] = {@NOMINALS@};

/* All that changes: a copy is a state of the FMU. */
typedef struct {
    double time;
    double given[GIVEN + 1]; /* inputs, then parameters */
    double states[STATES];
    double derivatives[STATES];
    double outputs[OUTPUTS + 1];
//? events
    double memory[@CAPITALS@_MEMORY]; /* of events */
    double sides[INDICATORS + 1];
//?
    int is_settled; /* whether derivatives and outputs are those of the values above */
    int mode;       /* one of the modes above */
} course;

static void begin(course *c)
{
    memset(c, 0, sizeof *c);
    c->mode = INSTANTIATED;
    @NAME@_init(c->states);
//? events
    @NAME@_begin(c->memory, c->sides);
//?
    for (int i = 0; i < GIVEN; i++) {
        c->given[i] = first_given[i];
    }
}

static void settle(course *c)
{
    if (!c->is_settled) {
        @NAME@_derivatives(c->time, c->states, c->given, c->derivatives);
        @NAME@_outputs(c->time, c->states, c->given, c->outputs);
        c->is_settled = 1;
    }
}

/* Goes on under the inputs as they are. */
static int step(course *c, double from, double to)
{
    int code;
    /* but for what a tool loses where it adds up its steps: a small part of one, and the last bits of times */
    if (!(fabs(from - c->time) <= 1e-6 * fabs(to - from) + 1e-15 * (fabs(from) + fabs(to)))) {
        return NOT_HERE;
    }
//? events
    code = @NAME@_advance(from, to, c->given, c->states, c->memory);
//?
//? !events
    code = @NAME@_advance(from, to, c->given, c->states);
//?
    if (code == 0) {
        c->time = to;
        c->is_settled = 0;
    }
    return code;
}

static int read_value(course *c, uint32_t reference, double *value)
{
    if (reference >= VALUES) {
        return NO_VALUE;
    }
//? events
    if (reference >= FIRST_INDICATOR) {
        double values[INDICATORS + 1];
        @NAME@_indicators(c->time, c->states, c->given, nominals, c->sides, values);
        *value = values[reference - FIRST_INDICATOR];
        return isfinite(*value) ? 0 : @CAPITALS@_NOT_FINITE;
    }
//?
    if (reference >= FIRST_PARAMETER) {
        *value = c->given[INPUTS + reference - FIRST_PARAMETER];
        return 0;
    }
    if (reference >= FIRST_DERIVATIVE) {
        settle(c);
        *value = reference >= FIRST_OUTPUT ? c->outputs[reference - FIRST_OUTPUT]
                                           : c->derivatives[reference - FIRST_DERIVATIVE];
        return isfinite(*value) ? 0 : @CAPITALS@_NOT_FINITE;
    }
    if (reference >= FIRST_STATE) {
        *value = c->states[reference - FIRST_STATE];
    } else if (reference >= FIRST_INPUT) {
        *value = c->given[reference - FIRST_INPUT];
    } else {
        *value = c->time;
    }
    return 0;
}

/* Why a value cannot be set now, or 0. */
static int refusal(const course *c, uint32_t reference, double value)
{
    (void)value;
    if (reference >= VALUES) {
        return NO_VALUE;
    }
    if ((reference >= FIRST_DERIVATIVE && reference < FIRST_PARAMETER) || reference < FIRST_INPUT
        || reference >= FIRST_INDICATOR) {
        return NOT_SETTABLE;
    }
    return reference >= FIRST_STATE && reference < FIRST_DERIVATIVE && (c->mode & BEFORE) == 0 ? NOT_NOW : 0;
}

static void write_value(course *c, uint32_t reference, double value)
{
    if (reference >= FIRST_PARAMETER) {
        c->given[INPUTS + reference - FIRST_PARAMETER] = value;
    } else if (reference < FIRST_STATE) {
        c->given[reference - FIRST_INPUT] = value;
    } else {
        c->states[reference - FIRST_STATE] = value;
    }
    c->is_settled = 0;
}

/* Model exchange: the states are the tool's. */
static int read_states(course *c, double *values, size_t count)
{
    for (size_t i = 0; i < count && count == STATES; i++) {
        values[i] = c->states[i];
    }
    return count == STATES ? 0 : NO_VALUE;
}

static int write_states(course *c, const double *values, size_t count)
{
    for (size_t i = 0; i < count && count == STATES; i++) {
        c->states[i] = values[i];
    }
    c->is_settled = 0;
    return count == STATES ? 0 : NO_VALUE;
}

static int read_derivatives(course *c, double *values, size_t count)
{
    int code = count == STATES ? 0 : NO_VALUE;
    for (size_t i = 0; i < count && code == 0; i++) {
        code = read_value(c, (uint32_t)(FIRST_DERIVATIVE + i), &values[i]);
    }
    return code;
}

static int read_nominals(double *values, size_t count)
{
    for (size_t i = 0; i < count && count == STATES; i++) {
        values[i] = nominals[i];
    }
    return count == STATES ? 0 : NO_VALUE;
}

/* What passes zero where a state may jump. */
static int read_indicators(course *c, double *values, size_t count)
{
    int code = count == INDICATORS ? 0 : NO_VALUE;
    for (size_t i = 0; i < count && code == 0; i++) {
        code = read_value(c, (uint32_t)(FIRST_INDICATOR + i), &values[i]);
    }
    return code;
}
//? events

/* What is due takes effect: whether states have changed, and when the clock has an event next. */
static int react(course *c, int *has_values, int *has_next, double *next)
{
    double before[STATES];
    int code = 0;
    memcpy(before, c->states, sizeof before);
    code = @NAME@_event(c->time, c->given, c->states, c->memory, c->sides);
    c->is_settled = 0;
    *has_values = memcmp(before, c->states, sizeof before) != 0;
    *has_next = @NAME@_next_instant(c->memory, next);
    return code;
}
//?

static void set_time(course *c, double time)
{
    c->time = time;
    c->is_settled = 0;
}

/* The Jacobian of the unknowns by the knowns, times the seed. What has no value has no slope either:
   that of log is finite where log is not. */
static int directional(
    course *c, const uint32_t *unknowns, size_t unknown_count, const uint32_t *knowns, size_t known_count,
    const double *seed, double *result)
{
    /* of time, the states, the inputs */
    double direction[1 + STATES + INPUTS] = {0.0};
    double derivatives[STATES];
    double outputs[OUTPUTS + 1];
    for (size_t i = 0; i < known_count; i++) {
        const uint32_t known = knowns[i];
        if (known >= FIRST_DERIVATIVE) {
            return NO_VALUE;
        } else if (known >= FIRST_STATE) {
            direction[1 + known - FIRST_STATE] = seed[i];
        } else if (known >= FIRST_INPUT) {
            direction[1 + STATES + known - FIRST_INPUT] = seed[i];
        } else {
            direction[0] = seed[i];
        }
    }
    @NAME@_along(c->time, c->states, c->given, direction, derivatives, outputs);
    for (size_t i = 0; i < unknown_count; i++) {
        const uint32_t unknown = unknowns[i];
        double value;
        int code;
        if (unknown < FIRST_STATE || unknown >= FIRST_PARAMETER) {
            return NO_VALUE;
        } else if (unknown >= FIRST_OUTPUT) {
            result[i] = outputs[unknown - FIRST_OUTPUT];
        } else if (unknown >= FIRST_DERIVATIVE) {
            result[i] = derivatives[unknown - FIRST_DERIVATIVE];
        } else {
            result[i] = direction[1 + unknown - FIRST_STATE];
        }
        code = read_value(c, unknown, &value);
        if (code != 0 || !isfinite(result[i])) {
            return code != 0 ? code : @CAPITALS@_NOT_FINITE;
        }
    }
    return 0;
}

