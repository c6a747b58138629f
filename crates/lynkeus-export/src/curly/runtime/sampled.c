/* The signals from a sample on: a measurement follows the model where its sensor did not report. */
static void start(STATE *s, const real *signals)
{
    for (int i = 0; i < INPUTS; i++) {
        if (isfinite(signals[SENSORS + i])) {
            s->inputs[i] = signals[SENSORS + i];
        }
    }
    for (int i = 0; i < SENSORS; i++) {
        s->inputs[INPUTS + i] = isfinite(signals[i]) ? FOLLOWS : R(1.0);
    }
}

/* Before a sensor's first reading the model's own output stands in for it. */
static int begin(STATE *s, double t)
{
    real y[OUTPUTS];
    outputs((real)t, s->x, s->inputs, y);
    for (int i = 0; i < OUTPUTS; i++) {
        if (!isfinite(y[i])) {
            return NOT_FINITE;
        }
    }
    for (int i = 0; i < SENSORS; i++) {
        s->x[OWN + i] = y[TOLD + i];
    }
    return 0;
}

/* From the sample before to t, under its inputs. */
static int advance(STATE *s, double t)
{
    const int steps = steps_between(s->time, t);
    if (steps == 0) {
        return INTERVAL;
    }
//? deviations
    return predict(FIELD, s->time, t, steps, s->inputs, s->x, s->root) ? 0 : NOT_FINITE;
//?
//? !deviations
    return integrate(FIELD, s->time, t, steps, s->inputs, s->x) ? 0 : NOT_FINITE;
//?
}

/* Takes the readings and inputs of a sample. */
static int update(STATE *s, double t, const real *signals)
{
    (void)t;
    start(s, signals);
//? deviations
    real c[SENSORS * STATES];
    for (int i = 0; i < SENSORS * STATES; i++) {
        c[i] = R(0.0);
    }
    reading_slopes((real)t, s->x, s->inputs, c);
//?
    for (int i = 0; i < SENSORS; i++) {
        if (isfinite(signals[i])) {
            s->x[OWN + i] = signals[i];
//? deviations
            reset(s->root, c, i, signals[i]);
//?
        }
        widen(s, s->x[OWN + i]);
    }
    for (int i = 0; i < INPUTS; i++) {
        widen(s, s->inputs[i]);
    }
    return 0;
}

/* The estimates, where all of them are numbers and none has run away. */
static int report(STATE *s, double t, real *estimates)
{
    real y[OUTPUTS];
//? deviations
    real deviations[ESTIMATED];
//?
    for (int i = 0; i < OWN; i++) {
        if (!isfinite(s->x[i]) || !(fabs(s->x[i]) <= R(1e12) * s->scale)) {
            return DIVERGED;
        }
    }
    outputs((real)t, s->x, s->inputs, y);
    for (int i = 0; i < OUTPUTS; i++) {
        if (!isfinite(y[i])) {
            return NOT_FINITE;
        }
    }
//? deviations
    real c[ESTIMATED * STATES];
    real projected[STATES];
    for (int i = 0; i < ESTIMATED * STATES; i++) {
        c[i] = R(0.0);
    }
    estimate_slopes((real)t, s->x, s->inputs, c);
    for (int i = 0; i < ESTIMATED; i++) {
        real sum = R(0.0);
        project(s->root, c, i, projected);
        for (int k = 0; k < STATES; k++) {
            sum += projected[k] * projected[k];
        }
        deviations[i] = sqrt(sum);
        if (!isfinite(deviations[i])) {
            return DIVERGED;
        }
    }
    for (int i = 0; i < ESTIMATED; i++) {
        estimates[ESTIMATED + i] = deviations[i];
    }
//?
    for (int i = 0; i < ESTIMATED; i++) {
        estimates[i] = y[i];
    }
    for (int i = ESTIMATED; i < TOLD; i++) {
        estimates[REPORTED - TOLD + i] = y[i];
    }
    return 0;
}
