/* One step of the classical Runge-Kutta method, from t to t + h. 0 where a value is not finite: z is then of no use. */
static truth leap(field f, double t, double h, const real *w, real *z)
{
    const real length = (real)h;
    real first[DIMENSION];
    real middle[DIMENSION];
    real last[DIMENSION];
    real stage[DIMENSION];
    f((real)t, z, w, first);
    for (int i = 0; i < DIMENSION; i++) {
        stage[i] = z[i] + length * R(0.5) * first[i];
    }
    f((real)(t + 0.5 * h), stage, w, middle);
    for (int i = 0; i < DIMENSION; i++) {
        stage[i] = z[i] + length * R(0.5) * middle[i];
    }
    f((real)(t + 0.5 * h), stage, w, last);
    for (int i = 0; i < DIMENSION; i++) {
        stage[i] = z[i] + length * last[i];
        middle[i] += last[i];
    }
    f((real)(t + h), stage, w, last);
    for (int i = 0; i < DIMENSION; i++) {
        z[i] += length / R(6.0) * (first[i] + R(2.0) * middle[i] + last[i]);
        if (!isfinite(z[i])) {
            return 0;
        }
    }
    return 1;
}
//? watched

/* The same from a state that stays, and what relations are at its end. */
static truth look(field f, double t, double h, const real *w, const real *start, real *z, real *holds, real *quantities)
{
    for (int i = 0; i < DIMENSION; i++) {
        z[i] = start[i];
    }
    if (!leap(f, t, h, w, z)) {
        return 0;
    }
    relations((real)(t + h), z, w, holds, quantities);
    return 1;
}
//?

/* What a jump makes of deviations: the saltation matrix. An event that was late moves the state, too. 0 where the state
   does not tell the time of the event. */
static truth carry_jump(int relation, real late, const real *old, double t, const real *w, const real *before, const real *after, const real *jump, double *m, real *z)
{
//? !carried
    (void)m;
//?
    real slopes[RELATIONS_ROOM * (STATES + 1)];
    real off[STATES];
    truth is_moved = 0;
//? carried
    real matrix[STATES * STATES];
    real rows[DIMENSION];
    for (int i = 0; i < STATES; i++) {
        for (int j = 0; j < STATES; j++) {
            matrix[i * STATES + j] = jump[i * (STATES + 1) + j];
        }
    }
//?
    for (int i = 0; i < STATES; i++) {
        real carried = R(0.0);
        for (int j = 0; j < STATES; j++) {
            carried += jump[i * (STATES + 1) + j] * before[j];
        }
        off[i] = after[i] - carried - jump[i * (STATES + 1) + STATES];
        if (relation < RELATIONS && (off[i] < R(0.0) || off[i] > R(0.0))) {
            is_moved = 1;
        }
    }
    if (is_moved) {
        const int row = relation * (STATES + 1);
        real made = R(0.0);
//? carried
        truth touches = 0;
//?
        for (int i = 0; i < RELATIONS * (STATES + 1); i++) {
            slopes[i] = R(0.0);
        }
        gradient((real)t, old, w, slopes);
        real rate = slopes[row + STATES];
        for (int j = 0; j < STATES; j++) {
            rate += slopes[row + j] * before[j];
            made += fabs(slopes[row + j] * before[j]);
//? carried
            if (slopes[row + j] < R(0.0) || slopes[row + j] > R(0.0)) {
                touches = 1;
            }
//?
        }
        const truth is_crossed = fabs(rate) > R(1e-9) * made ? 1 : 0;
//? carried
        if (!is_crossed && touches) {
            m[ENDLESS] = 1.0;
            return 0;
        }
//?
        for (int i = 0; i < STATES; i++) {
            if (is_crossed) {
//? carried
                for (int j = 0; j < STATES; j++) {
                    matrix[i * STATES + j] += off[i] * slopes[row + j] / rate;
                }
//?
                z[i] += off[i] * late;
            }
        }
    }
//? carried
    for (int i = STATES; i < DIMENSION; i++) {
        rows[i] = z[i];
        z[i] = R(0.0);
    }
    for (int i = 0; i < STATES; i++) {
        for (int j = 0; j < STATES; j++) {
            for (int k = 0; k < WIDTH; k++) {
                z[STATES + i * WIDTH + k] += matrix[i * STATES + j] * rows[STATES + j * WIDTH + k];
            }
        }
    }
//?
//? noisy
    for (int i = 0; i < STATES; i++) {
        for (int k = 0; k < STATES; k++) {
            rows[k] = z[STATES + i * WIDTH + STATES + k];
        }
        for (int j = 0; j < STATES; j++) {
            real sum = R(0.0);
            for (int k = 0; k < STATES; k++) {
                sum += rows[k] * matrix[j * STATES + k];
            }
            z[STATES + i * WIDTH + STATES + j] = sum;
        }
    }
//?
    return 1;
}

//? watched
/* Of steps from a state, their lengths halved from h on, at whose end z relations are no more what they were, about the
   shortest: its length, and which have changed. 0.0 where something has no value. */
static double first_change(field f, double t, double h, const real *w, const real *start, const real *was, real *z, truth *flipped)
{
    real end[DIMENSION];
    real there[RELATIONS_ROOM];
    real quantities[RELATIONS_ROOM];
    double low = 0.0;
    double high = h;
    int halvings = 0;
    for (int i = 0; i < DIMENSION; i++) {
        end[i] = z[i];
    }
    while (halvings < 50 && high - low > shortest(t + high)) {
        const double half = low + 0.5 * (high - low);
        halvings++;
        if (!look(f, t, half, w, start, z, there, quantities)) {
            return 0.0;
        }
        if (are_same(was, there)) {
            low = half;
        } else {
            high = half;
            for (int i = 0; i < DIMENSION; i++) {
                end[i] = z[i];
            }
        }
    }
    for (int i = 0; i < DIMENSION; i++) {
        z[i] = end[i];
    }
    relations((real)(t + high), z, w, there, quantities);
    for (int r = 0; r < RELATIONS; r++) {
        flipped[r] = is_same(was, there, r) ? 0 : 1;
    }
    return high;
}
//?

/* The event at t, in an interval of some length, after relations have changed. 0 where it has no end or no value;
   1: nothing has happened; 2: the state has jumped. */
static int occur(field f, double t, double length, const real *w, const truth *flipped, real *z, double *m)
{
    real old[DIMENSION];
    real before[DIMENSION];
    real after[DIMENSION];
    real late[RELATIONS_ROOM];
    truth causes[RELATIONS_ROOM];
    real jump[STATES * (STATES + 1)];
    const truth is_known = m[STARTED] > 0.0 && m[HAS_LAST] > 0.0 ? 1 : 0;
    int relation = RELATIONS;
    truth is_own = 0;
//? watched
    /* what is at the end of the interval comes at the start of the next one */
    if (any_of(flipped) && is_at_end(t, m)) {
        leave(t, w, z, flipped, m);
        return 1;
    }
//?
    for (int i = 0; i < DIMENSION; i++) {
        old[i] = z[i];
    }
    for (int r = 0; r < RELATIONS; r++) {
        causes[r] = flipped[r];
        late[r] = R(0.0);
    }
    f((real)t, z, w, before);
//? watched
    return_to(t, length, w, z, before, m, causes, late);
//?
    m[HAS_LAST] = 0.0;
    if (is_known) {
        if (!rebase(t, length, w, z, before, m, causes, late)) {
            return 0;
        }
    }
    for (int r = 0; r < RELATIONS; r++) {
        if (causes[r]) {
            is_own = 1;
        }
    }
    /* what the state causes by itself may be more than is allowed; the clock asks nobody */
    if (is_own && m[ALLOWED] >= 0.0 && m[HAPPENED] >= m[ALLOWED] && !is_time(t, m)) {
        return 1;
    }
    const int found = happen(t, w, z, m, jump);
    if (found == 0) {
        return 1;
    }
    if (found > CONDITIONS + 1) {
        return 0;
    }
    if (is_own) {
        m[HAPPENED] += 1.0;
    }
    for (int r = RELATIONS - 1; r >= 0; r--) {
        const int place = found > CONDITIONS ? 0 : (found - 1) * RELATIONS + r;
        if (causes[r] && (found > CONDITIONS || needs[place] != 0)) {
            relation = r;
        }
    }
    if (found <= CONDITIONS) {
        if (!hurried(t, found - 1, relation, m)) {
            return 0;
        }
    }
    f((real)t, z, w, after);
    return carry_jump(relation, relation < RELATIONS ? late[relation] : R(0.0), old, t, w, before, after, jump, m, z) ? 2 : 0;
}

/* One step with events in it: steps of halved lengths find the first that ends beyond a change. `sent` is a relation
   beyond which a jump has sent the state back: it may have left and be there again within a step. 0 where events have
   no end, or something no value. */
static truth pass(field f, double from, double to, const real *w, int sent, real *z, double *m)
{
//? !watched
    (void)m;
    (void)sent;
    return to - from > shortest(to) ? leap(f, from, to - from, w, z) : 1;
//?
//? watched
    real start[DIMENSION];
    real end[DIMENSION];
    real was[RELATIONS_ROOM];
    real now[RELATIONS_ROOM];
    real quantities[RELATIONS_ROOM];
    truth flipped[RELATIONS_ROOM];
    int behind = sent;
    double t = from;
    int count = 0;
    while (to - t > shortest(to)) {
        const double whole = to - t;
        count++;
        if (count > 10000) {
            m[ENDLESS] = 1.0;
            return 0;
        }
        double h = whole;
        for (int i = 0; i < DIMENSION; i++) {
            start[i] = z[i];
        }
        relations((real)t, start, w, was, quantities);
        if (!look(f, t, h, w, start, z, now, quantities)) {
            return 0;
        }
        if (behind < RELATIONS) {
            int halvings = 0;
            while (halvings < 50 && is_same(was, now, behind)) {
                h *= 0.5;
                halvings++;
                if (!look(f, t, h, w, start, z, now, quantities)) {
                    return 0;
                }
            }
            if (is_same(was, now, behind)) {
                h = whole;
                if (!look(f, t, h, w, start, z, now, quantities)) {
                    return 0;
                }
            }
            behind = RELATIONS;
        }
        if (are_same(was, now)) {
            t = h < whole ? t + h : to;
            if (m[SUSPECT] > 0.0) {
                /* what came ever sooner: whether it still holds the state back */
                const int suspect = (int)m[SUSPECT] - 1;
                real size = R(0.0);
                for (int i = 0; i < DIMENSION; i++) {
                    size = fabs(z[i]) > size ? fabs(z[i]) : size;
                }
                if (now[suspect] > R(0.5) && quantities[suspect] > R(1e-6) * size) {
                    m[ENDLESS] = 1.0;
                    return 0;
                }
            }
        } else {
            const double length = first_change(f, t, h, w, start, was, z, flipped);
            if (length <= 0.0) {
                return 0;
            }
            t = length < whole ? t + length : to;
            const int became = occur(f, t, to - from, w, flipped, z, m);
            if (became == 0) {
                return 0;
            }
            if (became == 2) {
                f((real)t, z, w, end);
                behind = sent_back(t, z, w, end, flipped);
            }
        }
    }
    return 1;
//?
}

/* Takes z along its field in equal steps of the classical Runge-Kutta method, through events, which m remembers. 0 where
   a value is not finite, or events have no end: z is then of no use. */
static truth integrate(field f, double from, double to, int steps, const real *w, real *z, double *m)
{
    truth flipped[RELATIONS_ROOM];
    for (int r = 0; r < RELATIONS; r++) {
        flipped[r] = 0;
    }
    m[FROM] = from;
    m[UNTIL] = to;
//? timers
    (void)steps;
    double start = from;
    int stops = 0;
    while (start < to) {
        stops++;
        if (stops > 1000000) {
            m[ENDLESS] = 1.0;
            return 0;
        }
        const double end = next_stop(from, start, to);
        const int count = steps_in(end - start, to - from);
//?
//? !timers
        const double start = from;
        const double end = to;
        const int count = steps;
//?
//? watched
        truth left[RELATIONS_ROOM];
        int behind = RELATIONS;
        for (int r = 0; r < RELATIONS; r++) {
            left[r] = is_kept(r, m);
        }
//?
        const int began = occur(f, start, end - start, w, flipped, z, m);
        if (began == 0) {
            return 0;
        }
//? watched
        if (began == 2) {
            real slope[DIMENSION];
            f((real)start, z, w, slope);
            behind = sent_back(start, z, w, slope, left);
        }
//?
        for (int step = 0; step < count; step++) {
            const double here = start + (end - start) * ((double)step / (double)count);
            const double next = start + (end - start) * ((double)(step + 1) / (double)count);
//? watched
            if (!pass(f, here, next, w, step == 0 ? behind : RELATIONS, z, m)) {
                return 0;
            }
//?
//? !watched
            if (!pass(f, here, next, w, RELATIONS, z, m)) {
                return 0;
            }
//?
        }
//? timers
        start = end;
    }
//?
    m[HAS_LAST] = 1.0;
    for (int i = 0; i < STATES; i++) {
        m[LAST + i] = (double)z[i];
    }
    return 1;
}
//? point_watched

/* The event that lies ahead of z at t, within a time, as if it had come by then: there, through it, and back again. 0
   where something has no value. */
static truth anticipate(field f, double t, double within, const real *w, real *z, double *m)
{
    real start[DIMENSION];
    real was[RELATIONS_ROOM];
    real now[RELATIONS_ROOM];
    real quantities[RELATIONS_ROOM];
    truth flipped[RELATIONS_ROOM];
    double h = 0.125 * within;
    int tries = 0;
    /* what was at the end of the interval lies at no distance */
    for (int r = 0; r < RELATIONS; r++) {
        flipped[r] = 0;
        if (is_kept(r, m)) {
            tries = 4;
        }
    }
    if (tries > 0) {
        return occur(f, t, within, w, flipped, z, m) == 0 ? 0 : 1;
    }
    for (int i = 0; i < DIMENSION; i++) {
        start[i] = z[i];
    }
    relations((real)t, start, w, was, quantities);
    while (tries < 4) {
        tries++;
        if (!look(f, t, h, w, start, z, now, quantities)) {
            return 0;
        }
        if (!are_same(was, now)) {
            const double length = first_change(f, t, h, w, start, was, z, flipped);
            if (length <= 0.0) {
                return 0;
            }
            const int became = occur(f, t + length, within, w, flipped, z, m);
            if (became == 0) {
                return 0;
            }
            if (became == 2) {
                return leap(f, t + length, -length, w, z);
            }
            tries = 4;
        }
        h *= 2.0;
    }
    for (int i = 0; i < DIMENSION; i++) {
        z[i] = start[i];
    }
    return 1;
}
//?
//? point_blind

/* The event that lies ahead of z at t, within a time, as if it had come by then: there, through it, and back again. 0
   where something has no value. */
static truth anticipate(field f, double t, double within, const real *w, real *z, double *m)
{
    (void)f;
    (void)t;
    (void)within;
    (void)w;
    (void)z;
    (void)m;
    return 1;
}
//?
