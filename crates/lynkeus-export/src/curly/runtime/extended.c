/* One reading, with the slopes and predictions of x before. 0 where it says nothing. */
static truth believe(STATE *s, int i, const real *c, const real *before, real predicted, real noise)
{
    real projected[STATES];
    real gain[STATES];
    real moved = R(0.0);
    for (int j = 0; j < STATES; j++) {
        moved += c[i * STATES + j] * (s->x[j] - before[j]);
    }
    project(s->root, c, i, projected);
//? !limits
    const real rest = READING_HERE - predicted - moved;
    const real variance = noise;
//?
//? limits
    real rest = shown_of(i, READING_HERE) - predicted - moved;
    real variance = noise;
    const real end = end_of(i, s->readings[i]);
    truth is_told = 1;
    if (end != R(0.0)) {
        real weighed[2];
        const real spread = dot(projected, 0, projected, 0, STATES);
        is_told = weigh(end, rest, spread, noise, weighed);
        if (is_told) {
            rest = weighed[0];
            variance = weighed[1];
        }
    }
    if (!is_told) {
        return 0;
    }
//?
    if (take_reading(s->root, projected, variance, gain)) {
        for (int j = 0; j < STATES; j++) {
            s->x[j] += gain[j] * rest;
        }
    }
    return 1;
}

/* The readings one after the other, all with the slopes and predictions of x before. 0 where the
   sensors' model has no value. */
static truth correct(STATE *s, double t)
{
    real h[SENSORS];
    real c[SENSORS * STATES];
    real before[STATES];
    real projected[STATES];
    real noises[SENSORS];
    truth believed[SENSORS];
    for (int i = 0; i < SENSORS * STATES; i++) {
        c[i] = R(0.0);
    }
    measure((real)t, s->x, s->inputs, h, c);
    for (int i = 0; i < SENSORS; i++) {
        if (!isfinite(h[i])) {
            return 0;
        }
    }
    for (int i = 0; i < SENSORS * STATES; i++) {
        if (!isfinite(c[i])) {
            return 0;
        }
    }
    for (int i = 0; i < STATES; i++) {
        before[i] = s->x[i];
    }
//? mirrors
    take_signs(s, h);
//?
    for (int i = 0; i < SENSORS; i++) {
        project(s->root, c, i, projected);
        const real spread = dot(projected, 0, projected, 0, STATES);
        believed[i] = judge(s, i, s->readings[i], h[i], spread, noises);
    }
    for (int i = 0; i < SENSORS; i++) {
//? limits
        if (end_of(i, s->readings[i]) != R(0.0)) {
            continue;
        }
//?
        if (believed[i] != 0) {
            (void)believe(s, i, c, before, h[i], noises[i]);
        }
    }
//? limits
    /* at the end of a range: what such a reading says depends on what the others leave */
    for (int i = 0; i < SENSORS; i++) {
        if (believed[i] != 0 && end_of(i, s->readings[i]) != R(0.0)) {
            (void)believe(s, i, c, before, h[i], noises[i]);
        }
    }
//?
    return 1;
}
