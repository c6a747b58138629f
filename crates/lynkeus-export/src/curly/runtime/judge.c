/* Whether a reading corrects the estimate; variance is that of its innovation. */
static truth judge(STATE *s, int i, real reading, real predicted, real variance)
{
    (void)predicted;
    if (!isfinite(reading)) {
        s->became[i] = MISSING;
        return 0;
    }
    s->became[i] = TAKEN;
    if (variance < R(0.0)) {
        s->became[i] = REJECTED;
    }
//? gate
    /* a gate must not lock the filter out for ever: a sensor that moves is believed in the end */
    const real spread = sqrt(variance > R(0.0) ? variance : R(0.0));
    const truth is_heard = s->rejected[i] >= 10 && s->moved[i] >= 5;
    if (!is_heard && fabs(reading - predicted) > GATE * spread) {
        s->became[i] = REJECTED;
    }
//?
//? limits
    if ((reading <= lowest[i] && predicted <= lowest[i]) || (reading >= highest[i] && predicted >= highest[i])) {
        s->became[i] = AT_LIMIT;
    }
//?
    if (s->became[i] == REJECTED) {
        s->rejected[i]++;
        s->moved[i] += reading != s->last[i] ? 1 : 0;
    } else {
        s->moved[i] = 0;
    }
    if (s->became[i] == TAKEN) {
        s->rejected[i] = 0;
    }
    s->last[i] = reading;
    return s->became[i] == TAKEN ? 1 : 0;
}
