/* A sample, whatever it leaves behind. */
static int take(STATE *s, double t, const real *signals, real *estimates)
{
//? !tunable
    int code = 0;
//?
    if (!isfinite(t) || (s->started && t < s->time)) {
        return TIME;
    }
//? tunable
    int code = tuned(s);
    if (code != 0) {
        return code;
    }
//?
    if (!s->started) {
        for (int i = SENSORS; i < SIGNALS; i++) {
            if (!isfinite(signals[i])) {
                return INPUT;
            }
        }
//? first
        FIRST_READINGS
//?
        for (int i = 0; i < STATES; i++) {
            widen(s, s->x[i]);
        }
//? sampled
        start(s, signals);
        code = begin(s, t);
//?
    } else if (t > s->time) {
        code = advance(s, t);
    } else {
        /* the same time again: more readings */
    }
    if (code == 0) {
        code = update(s, t, signals);
    }
    if (code == 0) {
        code = report(s, t, signals, estimates);
    }
    s->time = t;
    s->started = 1;
    s->refused = 0;
    return code;
}
