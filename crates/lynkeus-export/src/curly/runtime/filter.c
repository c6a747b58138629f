//? confined
/* Puts the estimate back into its declared ranges. */
static void confine(real *x)
{
    for (int i = 0; i < STATES; i++) {
        if (x[i] < range_from[i]) {
            x[i] = range_from[i];
        }
        if (x[i] > range_to[i]) {
            x[i] = range_to[i];
        }
    }
}

//?
/* From the sample before to t, under its inputs. */
static int advance(STATE *s, double t)
{
    const int steps = steps_between(s->time, t);
    for (int i = 0; i < INPUTS; i++) {
        widen(s, s->inputs[i]);
    }
    if (steps == 0) {
        return INTERVAL;
    }
    if (predict(FIELD, s->time, t, steps, s->inputs, s->x, s->rootMEMORY_OF_STATE)) {
//? rotations
        settle(s->x, s->root);
//?
        return 0;
    }
//? confined
    /* the model has no value on the way: once more, inside the declared ranges */
    confine(s->x);
    if (predict_inside(FIELD_INSIDE, s->time, t, steps, s->inputs, s->x, s->root)) {
//?
//? curved_inside
        settle(s->x, s->root);
//?
//? confined
        return 0;
    }
//?
//? events
    if (s->memory[ENDLESS] > 0.0) {
        return EVENTS;
    }
//?
    return NOT_FINITE;
}

/* Takes the readings and inputs of a sample. */
static int update(STATE *s, double t, const real *signals)
{
//? rotations
    real before[STATES];
    for (int i = 0; i < STATES; i++) {
        before[i] = s->x[i];
    }
//?
    for (int i = 0; i < SENSORS; i++) {
        s->readings[i] = signals[i];
    }
    for (int i = 0; i < INPUTS; i++) {
        if (isfinite(signals[SENSORS + i])) {
            s->inputs[i] = signals[SENSORS + i];
        }
    }
//? drawn
    /* errors of readings are other ones in each sample */
    for (int i = STATES - DRAWN; i < STATES; i++) {
        s->x[i] = R(0.0);
        for (int k = 0; k < STATES; k++) {
            s->root[i * STATES + k] = i == k ? R(1.0) : R(0.0);
        }
    }
//?
    if (correct(s, t)) {
//? rotations
        land(before, s->x, s->root);
//?
        return 0;
    }
//? confined
    confine(s->x);
    if (correct(s, t)) {
//?
//? curved_inside
        land(before, s->x, s->root);
//?
//? confined
        return 0;
    }
//?
    return NOT_FINITE;
}

/* The estimates, where all of them are numbers and none has run away. */
static int report(STATE *s, double t, const real *signals, real *estimates)
{
    real deviations[STATES];
    (void)t;
    (void)signals;
    for (int i = 0; i < STATES; i++) {
        if (!isfinite(s->x[i]) || !(fabs(s->x[i]) <= R(1e12) * s->scale)) {
            return DIVERGED;
        }
        deviations[i] = deviation(s->root, i);
        if (!isfinite(deviations[i])) {
            return DIVERGED;
        }
    }
    for (int i = 0; i < SHOWN; i++) {
        estimates[i] = s->x[i];
//? each
        estimates[SHOWN + i] = deviations[i];
//?
    }
//? turns
    for (int i = 0; i < TURNS; i++) {
        estimates[turn_states[i]] = in_turn(s->x[turn_states[i]], turns_from[i]);
    }
//?
//? one
    /* of a rotation the deviation of its angle, in one place */
    int place = SHOWN;
    for (int i = 0; i < SHOWN; i++) {
        if (elements[i] == 0) {
            real squares = R(0.0);
            for (int k = 0; k < 4; k++) {
                squares += deviations[i + k] * deviations[i + k];
            }
            estimates[place] = R(2.0) * sqrt(squares);
            place++;
        } else if (elements[i] == 4) {
            estimates[place] = deviations[i];
            place++;
        } else {
            /* told with the first of the four */
        }
    }
//?
    return 0;
}
