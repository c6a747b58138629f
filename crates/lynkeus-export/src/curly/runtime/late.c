
/* How much later than its sample is taken a reading comes, by sensor. */
static const double delays[@SENSORS@] = {@DELAYS@};

/* A sample of one sensor, or the row itself, that finds its place. */
typedef struct {
    double t;
    int sensor; /* -1: the row */
    int place;
    int is_new;
    @REAL@ was; /* what it stands in place of */
} arrival;

/* Whether a sample that came at `came` is one of the row at t: t - delay does not meet it to the bit. */
static int is_of_row(double taken, double t, double came)
{
    const double largest = fmax(fmax(fabs(taken), fabs(t)), fabs(came));
    return fabs(taken - t) <= 4.0 * 2.220446049250313e-16 * largest;
}

/* Leaves out the oldest rows. */
static void forget(@NAME@_state *s, int count)
{
    if (count > 0) {
        for (int k = count; k < s->count; k++) {
            s->rows[k - count] = s->rows[k];
        }
        s->count -= count;
        s->is_whole = 0;
    }
}

/* The first row that is not before a time. */
static int place_of(const @NAME@_state *s, double taken, double came)
{
    int place = 0;
    while (place < s->count && s->rows[place].t < taken && !is_of_row(taken, s->rows[place].t, came)) {
        place++;
    }
    return place;
}

/* An empty row in its place, the estimator before it that before the next. */
static void insert(@NAME@_state *s, int place, double t)
{
    for (int k = s->count; k > place; k--) {
        s->rows[k] = s->rows[k - 1];
    }
    if (place == s->count) {
        s->rows[place].before = s->now;
    }
    s->rows[place].t = t;
    for (int i = 0; i < @CAPITALS@_SIGNALS; i++) {
        s->rows[place].signals[i] = (@REAL@)NAN;
    }
    s->count++;
}

/* Takes a row or a sample out again. */
static void take_out(@NAME@_state *s, const arrival *a)
{
    if (!a->is_new) {
        if (a->sensor >= 0) {
            s->rows[a->place].signals[a->sensor] = a->was;
        }
        return;
    }
    s->count--;
    for (int k = a->place; k < s->count; k++) {
        const @NAME@_core before = s->rows[k].before;
        s->rows[k] = s->rows[k + 1];
        s->rows[k].before = before;
    }
}

/* Goes over the rows from one of them on; 0, or why one is refused. */
static int again(@NAME@_state *s, int from, @REAL@ *estimates)
{
    @NAME@_core now = s->rows[from].before;
    for (int k = from; k < s->count; k++) {
        s->rows[k].before = now;
        const int code = push_row(&now, s->rows[k].t, s->rows[k].signals, estimates);
        if (code != 0) {
            return code;
        }
    }
    s->now = now;
    return 0;
}

/* The very first row has the inputs that come first. */
static void begin_with_inputs(@NAME@_state *s)
{
    if (s->count == 0 || s->rows[0].before.started) {
        return;
    }
    for (int i = @SENSORS@; i < @CAPITALS@_SIGNALS; i++) {
        for (int k = 0; k < s->count && !isfinite(s->rows[0].signals[i]); k++) {
            s->rows[0].signals[i] = s->rows[k].signals[i];
        }
    }
}

/* A row with its samples in their places. */
static int take_late(@NAME@_state *s, double t, const @REAL@ *signals, @REAL@ *estimates)
{
    arrival arrived[@SENSORS@ + 1];
    @REAL@ were[@CAPITALS@_SIGNALS];
    int count = 0;
    int from;
    int code;
    if (!isfinite(t) || (s->count > 0 && t < s->rows[s->count - 1].t)) {
        return @CAPITALS@_TIME;
    }
    /* the oldest first */
    for (int i = 0; i < @SENSORS@; i++) {
        if (delays[i] > 0.0 && isfinite(signals[i])) {
            int k = count;
            while (k > 0 && arrived[k - 1].t > t - delays[i]) {
                arrived[k] = arrived[k - 1];
                k--;
            }
            arrived[k].t = t - delays[i];
            arrived[k].sensor = i;
            count++;
        }
    }
    arrived[count].t = t;
    arrived[count].sensor = -1;
    count++;
    from = 0;
    while (from + 1 < s->count && s->rows[from + 1].t <= t - @LONGEST@) {
        from++;
    }
    forget(s, from);
    if (s->count + count > @CAPITALS@_ROWS) {
        forget(s, s->count + count - @CAPITALS@_ROWS);
    }
    if (!s->is_whole && (s->count == 0 || arrived[0].t < s->rows[0].t) && count > 1
        && !(s->count > 0 && is_of_row(arrived[0].t, s->rows[0].t, t))) {
        return @CAPITALS@_ROOM;
    }
    for (int i = 0; i < @CAPITALS@_SIGNALS; i++) {
        were[i] = (@REAL@)NAN;
    }
    from = s->count;
    for (int a = 0; a < count; a++) {
        arrival *own = &arrived[a];
        own->place = place_of(s, own->t, t);
        own->is_new = own->place == s->count || !is_of_row(own->t, s->rows[own->place].t, t);
        if (own->is_new) {
            insert(s, own->place, own->t);
        }
        if (own->place < from) {
            from = own->place;
        }
        if (own->sensor >= 0) {
            own->was = s->rows[own->place].signals[own->sensor];
            s->rows[own->place].signals[own->sensor] = signals[own->sensor];
        } else {
            for (int i = 0; i < @CAPITALS@_SIGNALS; i++) {
                were[i] = s->rows[own->place].signals[i];
            }
            for (int i = 0; i < @CAPITALS@_SIGNALS; i++) {
                const int is_late = i < @SENSORS@ && delays[i < @SENSORS@ ? i : 0] > 0.0;
                if (!is_late && isfinite(signals[i])) {
                    s->rows[own->place].signals[i] = signals[i];
                }
            }
        }
    }
    begin_with_inputs(s);
    code = again(s, from, estimates);
    if (code != 0) {
        /* out again, the last that came first */
        @REAL@ told[@CAPITALS@_ESTIMATES];
        for (int i = 0; i < @CAPITALS@_SIGNALS; i++) {
            s->rows[arrived[count - 1].place].signals[i] = were[i];
        }
        for (int a = count - 1; a >= 0; a--) {
            take_out(s, &arrived[a]);
        }
        if (from < s->count) {
            (void)again(s, from, told);
        }
    }
    return code;
}

int @NAME@_push(@NAME@_state *s, double t, const @REAL@ *signals, @REAL@ *estimates)
{
    @REAL@ told[@CAPITALS@_ESTIMATES];
    const int code = take_late(s, t, signals, told);
    if (code == 0) {
        for (int i = 0; i < @CAPITALS@_ESTIMATES; i++) {
            estimates[i] = told[i];
        }
        s->refused = 0;
    }
    if (code == @CAPITALS@_DIVERGED || code == @CAPITALS@_NOT_FINITE) {
        s->refused++;
        if (s->refused >= @PATIENCE@) {
            @NAME@_init(s);
        }
    }
    return code;
}

void @NAME@_init(@NAME@_state *s)
{
    init_core(&s->now);
    s->count = 0;
    s->is_whole = 1;
    s->refused = 0;
}
