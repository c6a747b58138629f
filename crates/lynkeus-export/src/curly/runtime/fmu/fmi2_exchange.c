
typedef struct {
    fmi2Boolean is_unfinished;
    fmi2Boolean is_over;
    fmi2Boolean has_nominals;
    fmi2Boolean has_values;
    fmi2Boolean has_next;
    double next;
} events;

MODE(EnterEventMode, RUNNING, RUNNING)
MODE(EnterContinuousTimeMode, RUNNING, RUNNING)

/* Outputs follow what is set at once. */
API fmi2Status FULL(fmi2NewDiscreteStates)(void *instance, events *found)
{
    const events none = {0, 0, 0, 0, 0, 0.0};
    OPEN(RUNNING)
    *found = none;
//? events
    ONLY(m->is_exchange)
    return told(m, react(&m->at, &found->has_values, &found->has_next, &found->next));
//?
//? !events
    return fmi2OK;
//?
}

API fmi2Status FULL(fmi2CompletedIntegratorStep)(
    void *instance, fmi2Boolean is_past_fixed, fmi2Boolean *has_event, fmi2Boolean *is_over)
{
    OPEN(RUNNING)
    (void)is_past_fixed;
    *has_event = 0;
    *is_over = 0;
    return fmi2OK;
}

API fmi2Status FULL(fmi2SetTime)(void *instance, double time)
{
    OPEN(BEFORE | RUNNING)
    ONLY(m->is_exchange)
    set_time(&m->at, time);
    return fmi2OK;
}

API fmi2Status FULL(fmi2SetContinuousStates)(void *instance, const double *values, size_t count)
{
    OPEN(RUNNING)
    ONLY(m->is_exchange)
    return told(m, write_states(&m->at, values, count));
}

API fmi2Status FULL(fmi2GetContinuousStates)(void *instance, double *values, size_t count)
{
    OPEN(SINCE)
    return told(m, read_states(&m->at, values, count));
}

API fmi2Status FULL(fmi2GetDerivatives)(void *instance, double *values, size_t count)
{
    OPEN(SINCE)
    return told(m, read_derivatives(&m->at, values, count));
}

API fmi2Status FULL(fmi2GetNominalsOfContinuousStates)(void *instance, double *values, size_t count)
{
    return told(instance, read_nominals(values, count));
}

API fmi2Status FULL(fmi2GetEventIndicators)(void *instance, double *values, size_t count)
{
    OPEN(SINCE)
    return told(m, read_indicators(&m->at, values, count));
}

API fmi2Status FULL(fmi2GetDirectionalDerivative)(
    void *instance, const unsigned *unknowns, size_t unknown_count, const unsigned *knowns, size_t known_count,
    const double *seed, double *result)
{
    OPEN(SINCE)
    return told(m, directional(&m->at, unknowns, unknown_count, knowns, known_count, seed, result));
}
