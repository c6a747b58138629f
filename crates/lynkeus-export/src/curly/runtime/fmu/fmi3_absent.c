
/* What this FMU has not, but must answer. */
static fmi3Status absent(void *instance, size_t count)
{
    return told(instance, count == 0 ? 0 : NO_VALUE);
}

#define NO_VALUES(NAME, KIND)                                                                      \
    API fmi3Status FULL(fmi3Get##NAME)(                                                            \
        void *instance, const uint32_t *references, size_t count, KIND *values, size_t size)       \
    {                                                                                              \
        (void)references, (void)values, (void)size;                                                \
        return absent(instance, count);                                                            \
    }                                                                                              \
    API fmi3Status FULL(fmi3Set##NAME)(                                                            \
        void *instance, const uint32_t *references, size_t count, const KIND *values, size_t size) \
    {                                                                                              \
        (void)references, (void)values, (void)size;                                                \
        return absent(instance, count);                                                            \
    }

NO_VALUES(Float32, float)
NO_VALUES(Int8, int8_t)
NO_VALUES(UInt8, uint8_t)
NO_VALUES(Int16, int16_t)
NO_VALUES(UInt16, uint16_t)
NO_VALUES(Int32, int32_t)
NO_VALUES(UInt32, uint32_t)
NO_VALUES(Int64, int64_t)
NO_VALUES(UInt64, uint64_t)
NO_VALUES(Boolean, bool)
NO_VALUES(String, fmi3String)

API fmi3Status FULL(fmi3GetBinary)(
    void *instance, const uint32_t *references, size_t count, size_t *sizes, fmi3Binary *values, size_t size)
{
    (void)references, (void)sizes, (void)values, (void)size;
    return absent(instance, count);
}

API fmi3Status FULL(fmi3SetBinary)(
    void *instance, const uint32_t *references, size_t count, const size_t *sizes, const fmi3Binary *values,
    size_t size)
{
    (void)references, (void)sizes, (void)values, (void)size;
    return absent(instance, count);
}

#define NO_CLOCKS(NAME, ...)                                                                               \
    API fmi3Status FULL(fmi3##NAME)(void *instance, const uint32_t *references, size_t count, __VA_ARGS__) \
    {                                                                                                      \
        (void)references, (void)first;                                                                     \
        return absent(instance, count);                                                                    \
    }

#define NO_CLOCK_PAIRS(NAME, ...)                                                                          \
    API fmi3Status FULL(fmi3##NAME)(void *instance, const uint32_t *references, size_t count, __VA_ARGS__) \
    {                                                                                                      \
        (void)references, (void)first, (void)second;                                                       \
        return absent(instance, count);                                                                    \
    }

NO_CLOCKS(GetClock, bool *first)
NO_CLOCKS(SetClock, const bool *first)
NO_CLOCKS(GetShiftDecimal, double *first)
NO_CLOCKS(SetShiftDecimal, const double *first)
NO_CLOCKS(SetIntervalDecimal, const double *first)
NO_CLOCK_PAIRS(GetIntervalDecimal, double *first, int *second)
NO_CLOCK_PAIRS(GetShiftFraction, uint64_t *first, uint64_t *second)
NO_CLOCK_PAIRS(SetShiftFraction, const uint64_t *first, const uint64_t *second)
NO_CLOCK_PAIRS(SetIntervalFraction, const uint64_t *first, const uint64_t *second)

API fmi3Status FULL(fmi3GetIntervalFraction)(
    void *instance, const uint32_t *references, size_t count, uint64_t *counters, uint64_t *resolutions,
    int *qualifiers)
{
    (void)references, (void)counters, (void)resolutions, (void)qualifiers;
    return absent(instance, count);
}

API fmi3Status FULL(fmi3GetNumberOfVariableDependencies)(void *instance, uint32_t reference, size_t *count)
{
    (void)reference, (void)count;
    return told(instance, NOT_NOW);
}

API fmi3Status FULL(fmi3GetVariableDependencies)(
    void *instance, uint32_t dependent, size_t *elements, uint32_t *independents, size_t *others, int *kinds,
    size_t count)
{
    (void)dependent, (void)elements, (void)independents, (void)others, (void)kinds, (void)count;
    return told(instance, NOT_NOW);
}

#define NO_DERIVATIVES(NAME)                                                                            \
    API fmi3Status FULL(fmi3Get##NAME##Derivative)(                                                     \
        void *instance, const uint32_t *unknowns, size_t unknown_count, const uint32_t *knowns,         \
        size_t known_count, const double *seed, size_t seed_count, double *result, size_t result_count) \
    {                                                                                                   \
        (void)unknowns, (void)unknown_count, (void)knowns, (void)known_count;                           \
        (void)seed, (void)seed_count, (void)result, (void)result_count;                                 \
        return told(instance, NOT_NOW);                                                                 \
    }

//? !exchange
NO_DERIVATIVES(Directional)
//?
NO_DERIVATIVES(Adjoint)

API fmi3Status FULL(fmi3GetOutputDerivatives)(
    void *instance, const uint32_t *references, size_t count, const int32_t *orders, double *values,
    size_t size)
{
    (void)references, (void)orders, (void)values, (void)size;
    return absent(instance, count);
}

API fmi3Status FULL(fmi3EnterConfigurationMode)(void *instance)
{
    return told(instance, NOT_NOW);
}

API fmi3Status FULL(fmi3ExitConfigurationMode)(void *instance)
{
    return told(instance, NOT_NOW);
}

/* Of scheduled execution; some tools look for such functions in every FMU. */
API fmi3Status FULL(fmi3ActivateModelPartition)(void *instance, uint32_t clock, double time)
{
    (void)clock, (void)time;
    return told(instance, NOT_NOW);
}
//? !exchange

/* Of model exchange. */
API fmi3Status FULL(fmi3EnterContinuousTimeMode)(void *instance)
{
    return told(instance, NOT_NOW);
}

API fmi3Status FULL(fmi3CompletedIntegratorStep)(void *instance, bool is_past_fixed, bool *has_event, bool *is_over)
{
    (void)is_past_fixed, (void)has_event, (void)is_over;
    return told(instance, NOT_NOW);
}

API fmi3Status FULL(fmi3SetTime)(void *instance, double time)
{
    (void)time;
    return told(instance, NOT_NOW);
}

API fmi3Status FULL(fmi3SetContinuousStates)(void *instance, const double *values, size_t count)
{
    (void)values;
    return absent(instance, count);
}

#define NO_STATES(NAME)                                                              \
    API fmi3Status FULL(fmi3Get##NAME)(void *instance, double *values, size_t count) \
    {                                                                                \
        (void)values;                                                                \
        return absent(instance, count);                                              \
    }

NO_STATES(ContinuousStates)
NO_STATES(ContinuousStateDerivatives)
NO_STATES(NominalsOfContinuousStates)
NO_STATES(EventIndicators)

#define NO_NUMBER(NAME)                                                       \
    API fmi3Status FULL(fmi3GetNumberOf##NAME)(void *instance, size_t *count) \
    {                                                                         \
        (void)instance;                                                       \
        *count = 0;                                                           \
        return fmi3OK;                                                        \
    }

NO_NUMBER(ContinuousStates)
NO_NUMBER(EventIndicators)
//?
