/* Whether a reading corrects the estimate; spread is the variance of what is predicted. The
   variance of the reading's noise is left among the noises. */
static truth judge(STATE *s, int i, real reading, real predicted, real spread, real *noises)
{
    noises[i] = expected_noise(i, predicted, spread);
    if (!isfinite(reading)) {
        s->became[i] = MISSING;
        return 0;
    }
    const real variance = spread + noises[i];
    s->became[i] = TAKEN;
//? deviation
    const real deviation = sqrt(variance > R(0.0) ? variance : R(0.0));
//?
//? limits
    const real end = end_of(i, reading);
    const real outward = end * (shown_of(i, reading) - predicted);
    if (end != R(0.0) && (outward < R(0.0) || (!(outward > R(0.0)) && !(deviation > R(0.0))))) {
        s->became[i] = AT_LIMIT;
    }
//?
    if (s->became[i] == TAKEN && variance < R(0.0)) {
        s->became[i] = REJECTED;
    }
//? gate
    /* a gate must not lock the filter out for ever: a sensor that moves is believed in the end */
    const truth is_heard = s->rejected[i] >= LOCKED_OUT && s->moved[i] >= MOVED_OF_THEM;
    if (s->became[i] == TAKEN && !is_heard && fabs(SHOWN_READING - predicted) > GATE * deviation) {
        s->became[i] = REJECTED;
    }
//?
    if (s->became[i] == REJECTED) {
        s->rejected[i]++;
        s->moved[i] += reading != s->last[i] ? 1 : 0;
//? gate
        turn(s, i);
        s->kept_out[i]++;
//?
    } else {
        s->moved[i] = 0;
    }
    if (s->became[i] == TAKEN) {
        s->rejected[i] = 0;
        if (variance > R(0.0)) {
            const real off = SHOWN_READING - predicted;
            compare(s, i, off * off / variance);
        }
    }
    s->last[i] = reading;
//? relative
    /* a reading that contradicts the prediction has a say in how large its noise is */
    const real surprise = SURPRISE;
    if (fabs(surprise) > R(3.0) * deviation) {
        noises[i] = noise_after(i, reading, predicted, spread);
    }
//?
    return s->became[i] == REJECTED ? 0 : 1;
}
