/* What is due at t takes effect: 0, or a code, and then nothing has changed. From then on relations have these sides. */
static int event(double t, const real *w, real *x, double *m, double *sides)
{
    real z[STATES];
    real jump[STATES * (STATES + 1)];
    real holds[RELATIONS_ROOM];
    real quantities[RELATIONS_ROOM];
    double kept[MEMORY];
    truth has_end = 1;
    int found = 0;
    copy_state(x, z);
    for (int i = 0; i < MEMORY; i++) {
        kept[i] = m[i];
    }
    found = happen(t, w, z, m, jump);
    if (found > 0 && found <= CONDITIONS) {
        has_end = hurried(t, found - 1, RELATIONS, m);
    }
    if (found > CONDITIONS + 1 || !has_end) {
        const truth is_endless = m[ENDLESS] > 0.0 ? 1 : 0;
        for (int i = 0; i < MEMORY; i++) {
            m[i] = kept[i];
        }
        return is_endless ? EVENTS : NOT_FINITE;
    }
    copy_state(z, x);
    relations((real)t, x, w, holds, quantities);
    for (int r = 0; r < RELATIONS; r++) {
        sides[r] = holds[r] > R(0.5) ? 1.0 : -1.0;
    }
    return 0;
}

/* What passes zero where a relation changes, and a little beyond, so that what is found there has changed; sizes are
   those of the states. */
static void indicators(double t, const real *x, const real *w, const double *sizes, const double *sides, double *z)
{
    real holds[RELATIONS_ROOM];
    real quantities[RELATIONS_ROOM];
    real slopes[RELATIONS_ROOM * (STATES + 1)];
    relations((real)t, x, w, holds, quantities);
    for (int i = 0; i < RELATIONS * (STATES + 1); i++) {
        slopes[i] = R(0.0);
    }
    gradient((real)t, x, w, slopes);
    for (int r = 0; r < RELATIONS; r++) {
        double size = fabs((double)slopes[r * (STATES + 1) + STATES] * t);
        for (int j = 0; j < STATES; j++) {
            const double own = fabs((double)x[j]);
            size += fabs((double)slopes[r * (STATES + 1) + j]) * (own > sizes[j] ? own : sizes[j]);
        }
        z[r] = (double)quantities[r] + sides[r] * (1e-10 * size + 1e-14);
    }
}

/* The next instant at which the clock has an event: 1 where there is one. */
static truth next_instant(const double *m, double *next)
{
    truth is_there = 0;
//? !timers
    (void)m;
    (void)next;
//?
//? timers
    for (int i = 0; i < TIMERS; i++) {
        if (timer_is_initial[i] == 0) {
            const double own = instant_of(i, m[NEXT + i]);
            if (own < 1e17 && (!is_there || own < *next)) {
                *next = own;
                is_there = 1;
            }
        }
    }
//?
    return is_there;
}
