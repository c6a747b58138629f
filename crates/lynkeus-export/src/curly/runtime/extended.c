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

//? iterated
/* Whether the estimate is where it was, beside what is known of it. */
static truth stays(const real *before, const real *x, const real *root)
{
    for (int i = 0; i < STATES; i++) {
        if (!(fabs(x[i] - before[i]) <= R(1e-4) * deviation(root, i))) {
            return 0;
        }
    }
    return 1;
}

//?
//? iterated_rotations
/* Rows that are tangent at one place carried over to another. */
static void carry_rows(const real *from, const real *to, real *rows, int count)
{
    real way[4];
    real row[4];
    for (int r = 0; r < ROTATIONS; r++) {
        const int q = rotation_places[r];
        for (int i = 0; i < 4; i++) {
            row[i] = from[q + i];
        }
        way[0] = to[q] * row[0] + to[q + 1] * row[1] + to[q + 2] * row[2] + to[q + 3] * row[3];
        way[1] = to[q + 1] * row[0] - to[q] * row[1] - to[q + 2] * row[3] + to[q + 3] * row[2];
        way[2] = to[q + 2] * row[0] - to[q] * row[2] + to[q + 1] * row[3] - to[q + 3] * row[1];
        way[3] = to[q + 3] * row[0] - to[q] * row[3] - to[q + 1] * row[2] + to[q + 2] * row[1];
        for (int k = 0; k < count; k++) {
            for (int i = 0; i < 4; i++) {
                row[i] = rows[k * STATES + q + i];
            }
            rows[k * STATES + q] = way[0] * row[0] - way[1] * row[1] - way[2] * row[2] - way[3] * row[3];
            rows[k * STATES + q + 1] = way[0] * row[1] + way[1] * row[0] + way[2] * row[3] - way[3] * row[2];
            rows[k * STATES + q + 2] = way[0] * row[2] - way[1] * row[3] + way[2] * row[0] + way[3] * row[1];
            rows[k * STATES + q + 3] = way[0] * row[3] + way[1] * row[2] - way[2] * row[1] + way[3] * row[0];
        }
    }
}

//?
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
//? iterated
    real prior[STATES * STATES];
    real at[STATES];
    real about[STATES];
    truth goes_on = 0;
//?
//? iterated_rotations
    real at_step[STATES];
//?
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
//? iterated
    for (int i = 0; i < STATES * STATES; i++) {
        prior[i] = s->root[i];
    }
    for (int i = 0; i < STATES; i++) {
        at[i] = s->x[i];
    }
//?
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
//? iterated_rotations
    retract(before, s->x);
    flatten(before, s->x);
//?
//? iterated
    for (int i = 0; i < SENSORS; i++) {
        goes_on = goes_on || believed[i] != 0;
    }
    /* once more from before, with slopes and predictions where the readings led, until the estimate stays */
    for (int round = 1; round < ITERATIONS && goes_on; round++) {
        goes_on = !stays(at, s->x, s->root);
        for (int i = 0; i < STATES; i++) {
            at[i] = s->x[i];
            about[i] = at[i];
        }
//?
//? iterated_rotations
        retract(before, about);
//?
//? iterated
        for (int i = 0; i < SENSORS * STATES; i++) {
            c[i] = R(0.0);
        }
        if (goes_on) {
            measure((real)t, about, s->inputs, h, c);
        }
        for (int i = 0; i < SENSORS; i++) {
            goes_on = goes_on && isfinite(h[i]);
        }
        for (int i = 0; i < SENSORS * STATES; i++) {
            goes_on = goes_on && isfinite(c[i]);
        }
        if (goes_on) {
//?
//? iterated_rotations
            carry_rows(about, before, c, SENSORS);
//?
//? iterated
            for (int i = 0; i < STATES * STATES; i++) {
                s->root[i] = prior[i];
            }
            for (int i = 0; i < STATES; i++) {
                s->x[i] = before[i];
            }
            for (int i = 0; i < SENSORS; i++) {
                for (int j = 0; j < STATES; j++) {
                    h[i] -= c[i * STATES + j] * (at[j] - before[j]);
                }
            }
            for (int i = 0; i < SENSORS; i++) {
                if (ORDINARY) {
                    (void)believe(s, i, c, before, h[i], noises[i]);
                }
            }
//?
//? iterated_limits
            for (int i = 0; i < SENSORS; i++) {
                if (believed[i] != 0 && end_of(i, s->readings[i]) != R(0.0)) {
                    (void)believe(s, i, c, before, h[i], noises[i]);
                }
            }
//?
//? iterated_rotations
            /* the step is gone from the place itself, and kept by the shorter way */
            for (int i = 0; i < STATES; i++) {
                at_step[i] = s->x[i] - at[i];
            }
            carry_rows(before, about, at_step, 1);
            for (int i = 0; i < STATES; i++) {
                s->x[i] = about[i] + at_step[i];
            }
            retract(about, s->x);
            flatten(before, s->x);
//?
//? iterated
        }
    }
//?
    return 1;
}
