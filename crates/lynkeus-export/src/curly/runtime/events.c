//? timers
/* An instant of a timer. */
static double instant_of(int timer, double k)
{
    return (timer_firsts[timer] + k * timer_steps[timer]) / timer_scales[timer];
}

/* Which instant of a timer is the first that is not before t. */
static double first_instant(int timer, double t)
{
    const double size = t < 0.0 ? -t : t;
    const double about = ceil((t * timer_scales[timer] - timer_firsts[timer]) / timer_steps[timer]) - 2.0;
    double k = about > 0.0 ? about : 0.0;
    while (instant_of(timer, k) < t - 1.7763568394002505e-15 * size) {
        k += 1.0;
    }
    return k;
}

/* The first instant of a timer behind start, between from and to; or to. */
static double next_stop(double from, double start, double to)
{
    double stop = to;
    for (int i = 0; i < TIMERS; i++) {
        if (timer_is_initial[i] == 0) {
            double k = first_instant(i, start);
            double own = instant_of(i, k);
            double size = own < 0.0 ? -own : own;
            while (own < stop && (own <= from || own - start <= 8.881784197001252e-16 * size)) {
                k += 1.0;
                own = instant_of(i, k);
                size = own < 0.0 ? -own : own;
            }
            stop = own < stop ? own : stop;
        }
    }
    return stop;
}

/* Which timers are due at t, among what clauses read: 1 where some are. */
static truth due(double t, truth is_first, real *v, double *m)
{
    const double size = t < 0.0 ? -t : t;
    truth is_due = 0;
    for (int i = 0; i < TIMERS; i++) {
        truth is_now = 0;
        if (timer_is_initial[i] != 0) {
            is_now = is_first;
        } else if (instant_of(i, m[NEXT + i]) <= t + 1.7763568394002505e-15 * size) {
            is_now = 1;
            m[NEXT + i] = first_instant(i, t) + 1.0;
        } else {
            /* later */
        }
        v[INPUTS + STATES + i] = is_now ? R(1.0) : R(0.0);
        if (is_now) {
            is_due = 1;
        }
    }
    return is_due;
}

//?
/* Whether the clock has an event at t. */
static truth is_time(double t, const double *m)
{
//? timers
    const double size = t < 0.0 ? -t : t;
    for (int i = 0; i < TIMERS; i++) {
        if (timer_is_initial[i] == 0 && instant_of(i, m[NEXT + i]) <= t + 1.7763568394002505e-15 * size) {
            return 1;
        }
    }
//?
//? !timers
    (void)t;
    (void)m;
//?
    return 0;
}

/* What clauses read of the states before an event. */
static void remember(const real *before, real *v)
{
    for (int i = 0; i < STATES; i++) {
        v[INPUTS + i] = before[i];
    }
}

/* What clauses read where no timer is due. */
static void view(const real *w, const real *before, real *v)
{
    for (int i = 0; i < INPUTS; i++) {
        v[i] = w[i];
    }
    remember(before, v);
    for (int i = 0; i < TIMERS; i++) {
        v[INPUTS + STATES + i] = R(0.0);
    }
}

/* A clause takes effect; with the slopes of the jump so far, and before the round. 0 where it has no value. */
static truth apply(int clause, double t, const real *v, const real *kept, real *x, real *jump)
{
    real values[CHANGES];
    real slopes[CHANGES * (2 * STATES + 1)];
    real rows[CHANGES * (STATES + 1)];
    new_values((real)t, x, v, values);
    for (int i = 0; i < CHANGES * (2 * STATES + 1); i++) {
        slopes[i] = R(0.0);
    }
    value_slopes((real)t, x, v, slopes);
    for (int c = first_changes[clause]; c < first_changes[clause + 1]; c++) {
        if (!isfinite(values[c])) {
            return 0;
        }
        for (int j = 0; j <= STATES; j++) {
            real sum = j < STATES ? R(0.0) : slopes[c * (2 * STATES + 1) + 2 * STATES];
            for (int i = 0; i < STATES; i++) {
                sum += slopes[c * (2 * STATES + 1) + i] * jump[i * (STATES + 1) + j];
                sum += slopes[c * (2 * STATES + 1) + STATES + i] * kept[i * (STATES + 1) + j];
            }
            rows[c * (STATES + 1) + j] = sum;
        }
    }
    for (int c = first_changes[clause]; c < first_changes[clause + 1]; c++) {
        x[changed[c]] = values[c];
        for (int j = 0; j <= STATES; j++) {
            jump[changed[c] * (STATES + 1) + j] = rows[c * (STATES + 1) + j];
        }
    }
    return 1;
}

/* The equations of discrete variables. 0 where one has no value. */
static truth always(double t, const real *v, const real *kept, real *x, real *jump)
{
    for (int k = 0; k < CLAUSES; k++) {
        if (first_conditions[k] == first_conditions[k + 1]) {
            if (!apply(k, t, v, kept, x, jump)) {
                return 0;
            }
        }
    }
    return 1;
}

/* Whether two states are alike. */
static truth are_alike(const real *a, const real *b)
{
    for (int i = 0; i < STATES; i++) {
        if (a[i] < b[i] || a[i] > b[i]) {
            return 0;
        }
    }
    return 1;
}

static void copy_state(const real *from, real *to)
{
    for (int i = 0; i < STATES; i++) {
        to[i] = from[i];
    }
}

static void copy_jump(const real *from, real *to)
{
    for (int i = 0; i < STATES * (STATES + 1); i++) {
        to[i] = from[i];
    }
}

/* No jump. */
static void begin_jump(real *jump)
{
    for (int i = 0; i < STATES; i++) {
        for (int j = 0; j <= STATES; j++) {
            jump[i * (STATES + 1) + j] = i == j ? R(1.0) : R(0.0);
        }
    }
}

/* The first event of all is about to come. */
static void begin_memory(double t, double *m)
{
    m[STARTED] = 1.0;
//? !timers
    (void)t;
//?
//? timers
    for (int i = 0; i < TIMERS; i++) {
        m[NEXT + i] = timer_is_initial[i] == 0 ? first_instant(i, t) : 0.0;
    }
//?
    for (int k = 0; k < CLAUSES; k++) {
        m[HURRY + 4 * k + 1] = -1.0;
    }
}

/* Lets clauses take effect by what they read, in rounds. 0: nothing has happened; from 1 on the condition that came
   to hold first; CONDITIONS + 1: without one; CONDITIONS + 2: it has no end or no value. */
static int happen(double t, const real *w, real *x, double *m, real *jump)
{
    real v[VIEW];
    real start[STATES];
    real old[STATES];
    real before[STATES];
    real kept[STATES * (STATES + 1)];
    real kept_next[STATES * (STATES + 1)];
    real truths[CONDITIONS_ROOM];
    truth rising[CONDITIONS_ROOM];
    truth done[CLAUSES];
    int first = 0;
    const truth is_first = m[STARTED] > 0.0 ? 0 : 1;
    begin_jump(jump);
    view(w, x, v);
    copy_state(x, start);
    copy_jump(jump, kept);
    if (is_first) {
        begin_memory(t, m);
        /* what holds from the start on is no event */
        if (!always(t, v, kept, x, jump)) {
            return CONDITIONS + 2;
        }
        remember(x, v);
        conditions((real)t, x, v, truths);
        for (int c = 0; c < CONDITIONS; c++) {
            m[TRUTHS + c] = (double)truths[c];
        }
    }
    copy_state(x, old);
    copy_jump(jump, kept);
    for (int round = 0; round < 100; round++) {
        truth is_done = 0;
        copy_state(x, before);
        copy_jump(jump, kept_next);
//? !timers
        const truth is_due = 0;
//?
//? timers
        truth is_due = 0;
        if (round == 0) {
            is_due = due(t, is_first, v, m);
        }
//?
        remember(old, v);
        if (!always(t, v, kept, x, jump)) {
            return CONDITIONS + 2;
        }
        conditions((real)t, x, v, truths);
        for (int c = 0; c < CONDITIONS; c++) {
            rising[c] = truths[c] > R(0.5) && m[TRUTHS + c] < 0.5 ? 1 : 0;
            m[TRUTHS + c] = (double)truths[c];
        }
        for (int k = 0; k < CLAUSES; k++) {
            int risen = CONDITIONS;
            truth is_taken = 0;
            for (int c = first_conditions[k]; c < first_conditions[k + 1]; c++) {
                if (rising[c] && risen == CONDITIONS) {
                    risen = c;
                }
            }
            for (int j = 0; j < k; j++) {
                if (done[j] && groups[j] == groups[k]) {
                    is_taken = 1;
                }
            }
            done[k] = risen < CONDITIONS && !is_taken ? 1 : 0;
            if (done[k]) {
                if (!apply(k, t, v, kept, x, jump)) {
                    return CONDITIONS + 2;
                }
                first = first == 0 ? 1 + risen : first;
                is_done = 1;
            }
        }
        if (!is_done && !is_due && are_alike(before, x) && are_alike(old, before)) {
            if (first == 0 && !are_alike(start, x)) {
                return CONDITIONS + 1;
            }
            return first;
        }
        for (int i = 0; i < TIMERS; i++) {
            v[INPUTS + STATES + i] = R(0.0);
        }
        copy_state(before, old);
        copy_jump(kept_next, kept);
    }
    m[ENDLESS] = 1.0;
    return CONDITIONS + 2;
}

/* A condition came to hold at t, because of a relation (RELATIONS: of none). 0 where events follow each other
   without time going on. */
static truth hurried(double t, int condition, int relation, double *m)
{
    /* when its clause took effect last, how long after the time before (below 0: never), how often in a row sooner
       than before, and since when */
    const int own = HURRY + 4 * clause_of[condition];
    const double size = t < 0.0 ? -t : t;
    const truth is_known = m[own + 1] < 0.0 ? 0 : 1;
    const double apart = is_known ? t - m[own] : 1e300;
    const truth is_sooner = is_known && (apart < m[own + 1] || apart <= 1e-12 * size) ? 1 : 0;
    m[own] = t;
    m[own + 1] = apart;
    m[own + 2] = is_sooner ? m[own + 2] + 1.0 : 0.0;
    m[own + 3] = is_sooner ? m[own + 3] : t;
    m[SUSPECT] = 0.0;
    if (m[own + 2] >= 5.0 && apart <= 1e-4 * (t - m[own + 3]) && relation < RELATIONS) {
        m[SUSPECT] = 1.0 + (double)relation;
    }
    m[AT_ONCE] = t - m[NEWEST] <= 1e-12 * size ? m[AT_ONCE] + 1.0 : 0.0;
    m[NEWEST] = t;
    if (m[AT_ONCE] > 200.0) {
        m[ENDLESS] = 1.0;
        return 0;
    }
    return 1;
}

/* How fast the quantities of relations change as x moves with dx. */
static void speeds(double t, const real *x, const real *w, const real *dx, real *rates)
{
    real slopes[RELATIONS_ROOM * (STATES + 1)];
    for (int i = 0; i < RELATIONS * (STATES + 1); i++) {
        slopes[i] = R(0.0);
    }
    gradient((real)t, x, w, slopes);
    for (int r = 0; r < RELATIONS; r++) {
        rates[r] = slopes[r * (STATES + 1) + STATES];
        for (int j = 0; j < STATES; j++) {
            rates[r] += slopes[r * (STATES + 1) + j] * dx[j];
        }
    }
}

/* What was changed of x since the last event or interval is no event, but where the flow goes on into it: causes that
   are late, and by how much. 0 where a clause has no value. */
static truth rebase(double t, double length, const real *w, const real *x, const real *dx, double *m, truth *causes, real *late)
{
    real was[RELATIONS_ROOM];
    real now[RELATIONS_ROOM];
    real quantities[RELATIONS_ROOM];
    real rates[RELATIONS_ROOM];
    real before[STATES];
    real v[VIEW];
    real jump[STATES * (STATES + 1)];
    real kept[STATES * (STATES + 1)];
    real truths[CONDITIONS_ROOM];
    truth outward[RELATIONS_ROOM];
    truth flips[RELATIONS_ROOM];
    for (int i = 0; i < STATES; i++) {
        before[i] = (real)m[LAST + i];
    }
    if (are_alike(before, x)) {
        return 1;
    }
    relations((real)t, before, w, was, quantities);
    relations((real)t, x, w, now, quantities);
    speeds(t, x, w, dx, rates);
    for (int r = 0; r < RELATIONS; r++) {
        flips[r] = (was[r] > R(0.5) && now[r] < R(0.5)) || (was[r] < R(0.5) && now[r] > R(0.5)) ? 1 : 0;
        outward[r] = now[r] > R(0.5) ? rates[r] < R(0.0) : rates[r] > R(0.0);
        if (flips[r] && !outward[r]) {
            const real ago = quantities[r] / rates[r];
            causes[r] = 1;
            late[r] = ago < R(0.0) ? R(0.0) : (ago > (real)length ? (real)length : ago);
        }
    }
    copy_state(x, before);
    view(w, x, v);
    begin_jump(jump);
    copy_jump(jump, kept);
    if (!always(t, v, kept, before, jump)) {
        return 0;
    }
    remember(before, v);
    conditions((real)t, before, v, truths);
    for (int c = 0; c < CONDITIONS; c++) {
        truth leaves = 0;
        truth stays = 0;
        for (int r = 0; r < RELATIONS; r++) {
            if (needs[c * RELATIONS + r] != 0 && flips[r]) {
                if (outward[r]) {
                    leaves = 1;
                } else {
                    stays = 1;
                }
            }
        }
        if (truths[c] < R(0.5) || (leaves && !stays)) {
            m[TRUTHS + c] = (double)truths[c];
        }
    }
    return 1;
}
//? watched

/* Whether a relation is the same here and there. */
static truth is_same(const real *a, const real *b, int r)
{
    return (a[r] > R(0.5) && b[r] > R(0.5)) || (a[r] < R(0.5) && b[r] < R(0.5)) ? 1 : 0;
}

/* Whether all are. */
static truth are_same(const real *a, const real *b)
{
    for (int r = 0; r < RELATIONS; r++) {
        if (!is_same(a, b, r)) {
            return 0;
        }
    }
    return 1;
}

/* The relation that is left behind an event whose surface was passed; RELATIONS for none. */
static int sent_back(double t, const real *x, const real *w, const real *dx, const truth *flipped)
{
    real holds[RELATIONS_ROOM];
    real quantities[RELATIONS_ROOM];
    real rates[RELATIONS_ROOM];
    int found = RELATIONS;
    relations((real)t, x, w, holds, quantities);
    speeds(t, x, w, dx, rates);
    for (int r = RELATIONS - 1; r >= 0; r--) {
        const truth is_left = holds[r] > R(0.5) ? rates[r] < R(0.0) : rates[r] > R(0.0);
        if (flipped[r] && is_left) {
            found = r;
        }
    }
    return found;
}

/* Whether one of the relations has changed. */
static truth any_of(const truth *flipped)
{
    for (int r = 0; r < RELATIONS; r++) {
        if (flipped[r]) {
            return 1;
        }
    }
    return 0;
}

/* Whether t is the end of the interval, as near as makes no difference. */
static truth is_at_end(double t, const double *m)
{
    const double size = t < 0.0 ? -t : t;
    const double left = m[UNTIL] - t;
    return left >= 0.0 && left <= 1e-9 * (m[UNTIL] - m[FROM]) + 1.7763568394002505e-15 * size ? 1 : 0;
}

/* Whether a relation is kept for the next interval. */
static truth is_kept(int r, const double *m)
{
    return m[LEFT + r] > 0.0 || m[LEFT + r] < 0.0 ? 1 : 0;
}

/* Keeps for the next interval which relations have changed, and whether they hold. */
static void leave(double t, const real *w, const real *z, const truth *flipped, double *m)
{
    real holds[RELATIONS_ROOM];
    real quantities[RELATIONS_ROOM];
    relations((real)t, z, w, holds, quantities);
    for (int r = 0; r < RELATIONS; r++) {
        if (flipped[r]) {
            m[LEFT + r] = holds[r] > R(0.5) ? 1.0 : -1.0;
        }
    }
}

/* What was kept are causes now, but for what a correction has taken back. */
static void return_to(double t, double length, const real *w, const real *z, const real *dx, double *m, truth *causes, real *late)
{
    real holds[RELATIONS_ROOM];
    real quantities[RELATIONS_ROOM];
    real rates[RELATIONS_ROOM];
    truth is_any = 0;
    for (int r = 0; r < RELATIONS; r++) {
        if (is_kept(r, m)) {
            is_any = 1;
        }
    }
    if (is_any) {
        relations((real)t, z, w, holds, quantities);
        speeds(t, z, w, dx, rates);
        for (int r = 0; r < RELATIONS; r++) {
            const truth is_same_side = (m[LEFT + r] > 0.0 && holds[r] > R(0.5)) || (m[LEFT + r] < 0.0 && holds[r] < R(0.5)) ? 1 : 0;
            m[LEFT + r] = 0.0;
            if (is_same_side && !causes[r]) {
                const real ago = quantities[r] / rates[r];
                causes[r] = 1;
                late[r] = ago < R(0.0) ? R(0.0) : (ago > (real)length ? (real)length : ago);
            }
        }
    }
}
//?

/* Steps shorter than this do not move time reliably. */
static double shortest(double t)
{
    const double least = 3.552713678800501e-15 * (t < 0.0 ? -t : t);
    return least > 2.2250738585072014e-308 ? least : 2.2250738585072014e-308;
}
//? timers

/* How many equal steps make a piece of an interval of some length. */
static int steps_in(double piece, double length)
{
    const double count = ceil(piece / STEP_LENGTH * (1.0 - 1e-12));
    return count < 1.0 ? 1 : (int)count;
}
//?
