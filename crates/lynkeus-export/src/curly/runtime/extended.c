/* The readings one after the other, all with the slopes and predictions of x before. 0 where the
   sensors' model has no value. */
static truth correct(STATE *s, double t)
{
    real h[SENSORS];
    real c[SENSORS * STATES];
    real before[STATES];
    real projected[STATES];
    real gain[STATES];
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
    for (int i = 0; i < SENSORS; i++) {
        project(s->root, c, i, projected);
        const real variance = dot(projected, 0, projected, 0, STATES) + noise_variance(i, h[i]);
        believed[i] = judge(s, i, s->readings[i], h[i], variance);
    }
    for (int i = 0; i < SENSORS; i++) {
        if (believed[i] != 0) {
            real moved = R(0.0);
            for (int j = 0; j < STATES; j++) {
                moved += c[i * STATES + j] * (s->x[j] - before[j]);
            }
            const real rest = s->readings[i] - h[i] - moved;
            project(s->root, c, i, projected);
            if (take_reading(s->root, projected, noise_variance(i, h[i]), gain)) {
                for (int j = 0; j < STATES; j++) {
                    s->x[j] += gain[j] * rest;
                }
            }
        }
    }
    return 1;
}
