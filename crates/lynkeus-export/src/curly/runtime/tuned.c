/* What follows from the numbers that may be changed. */
static int tuned(STATE *s)
{
    for (int i = 0; i < TUNABLES; i++) {
        if (!isfinite(s->tuning[i]) || !(s->tuning[i] > R(0.0))) {
            return TUNING;
        }
    }
//? gains
    int is_new = 0;
    for (int i = 0; i < TUNABLES; i++) {
        if (s->tuning[i] < s->tuned_for[i] || s->tuning[i] > s->tuned_for[i]) {
            is_new = 1;
        }
        s->tuned_for[i] = s->tuning[i];
    }
    if (is_new != 0) {
        real gains[TUNED];
        tune(R(0.0), s->tuning, s->tuning, gains);
        for (int i = 0; i < TUNED; i++) {
            s->inputs[SIGNALS + i] = gains[i];
        }
    }
//?
//? !gains
    for (int i = 0; i < TUNABLES; i++) {
        s->inputs[INPUTS + i] = s->tuning[i];
    }
//?
    return 0;
}
