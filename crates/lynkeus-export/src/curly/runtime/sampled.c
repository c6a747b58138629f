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
//? drawn
    /* errors of readings of inputs are other ones in each sample */
    real nothing[STATES];
    for (int k = 0; k < STATES; k++) {
        nothing[k] = R(0.0);
    }
    for (int i = OWN - DRAWN; i < OWN; i++) {
        renew(s->root, i, nothing, R(1.0));
    }
//?
//? weighed
    real y[OUTPUTS];
    real spread[STATES];
    outputs((real)t, s->x, s->inputs, y);
//?
    for (int i = 0; i < SENSORS; i++) {
        if (isfinite(signals[i])) {
//? weighed
            const real off = signals[i] - y[TOLD + i];
            project(s->root, c, i, spread);
            const real variance = dot(spread, 0, spread, 0, STATES) + noise_variance(i, y[TOLD + i]);
            if (variance > R(0.0)) {
                compare(s, i, off * off / variance);
            }
//?
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

//? judged
/* Readings beside what is expected of them, which those that are held lag behind by as much as it has moved. */
static void follow(STATE *s, const real *signals, const real *y)
{
    for (int i = 0; i < SENSORS; i++) {
        const real expected = y[TOLD + i];
        const real lag = s->started ? expected - s->expected[i] : R(0.0);
        const real variance = noise_variance(i, expected) + lag * lag;
        const real off = signals[i] - expected;
        s->expected[i] = expected;
        if (isfinite(off) && variance > R(0.0)) {
            compare(s, i, off * off / variance);
        }
    }
}

//?
/* The estimates, where all of them are numbers and none has run away. */
static int report(STATE *s, double t, const real *signals, real *estimates)
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
//? judged
    follow(s, signals, y);
//?
//? !judged
    (void)signals;
//?
    return 0;
}
