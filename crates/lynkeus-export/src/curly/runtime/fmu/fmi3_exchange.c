
MODE(EnterContinuousTimeMode, RUNNING, RUNNING)

API fmi3Status FULL(fmi3CompletedIntegratorStep)(void *instance, bool is_past_fixed, bool *has_event, bool *is_over)
{
    OPEN(RUNNING)
    (void)is_past_fixed;
    *has_event = false;
    *is_over = false;
    return fmi3OK;
}

API fmi3Status FULL(fmi3SetTime)(void *instance, double time)
{
    OPEN(BEFORE | RUNNING)
    ONLY(m->is_exchange)
    set_time(&m->at, time);
    return fmi3OK;
}

API fmi3Status FULL(fmi3SetContinuousStates)(void *instance, const double *values, size_t count)
{
    OPEN(RUNNING)
    ONLY(m->is_exchange)
    return told(m, write_states(&m->at, values, count));
}

API fmi3Status FULL(fmi3GetContinuousStates)(void *instance, double *values, size_t count)
{
    OPEN(SINCE)
    return told(m, read_states(&m->at, values, count));
}

API fmi3Status FULL(fmi3GetContinuousStateDerivatives)(void *instance, double *values, size_t count)
{
    OPEN(SINCE)
    return told(m, read_derivatives(&m->at, values, count));
}

API fmi3Status FULL(fmi3GetNominalsOfContinuousStates)(void *instance, double *values, size_t count)
{
    return told(instance, read_nominals(values, count));
}

API fmi3Status FULL(fmi3GetNumberOfContinuousStates)(void *instance, size_t *count)
{
    (void)instance;
    *count = STATES;
    return fmi3OK;
}

API fmi3Status FULL(fmi3GetNumberOfEventIndicators)(void *instance, size_t *count)
{
    (void)instance;
    *count = INDICATORS;
    return fmi3OK;
}

API fmi3Status FULL(fmi3GetEventIndicators)(void *instance, double *values, size_t count)
{
    OPEN(SINCE)
    return told(m, read_indicators(&m->at, values, count));
}

API fmi3Status FULL(fmi3GetDirectionalDerivative)(
    void *instance, const uint32_t *unknowns, size_t unknown_count, const uint32_t *knowns, size_t known_count,
    const double *seed, size_t seed_count, double *result, size_t result_count)
{
    OPEN(SINCE)
    if (seed_count != known_count || result_count != unknown_count) {
        return told(m, NO_VALUE);
    }
    return told(m, directional(&m->at, unknowns, unknown_count, knowns, known_count, seed, result));
}
