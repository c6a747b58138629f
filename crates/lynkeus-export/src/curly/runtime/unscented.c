/* Sigma points: x, and x plus or minus the columns of the root of P times SPREAD. */
static void draw(const real *x, const real *root, real *points)
{
    for (int i = 0; i < STATES; i++) {
        points[i] = x[i];
    }
    for (int k = 0; k < STATES; k++) {
        for (int i = 0; i < STATES; i++) {
            points[(1 + k) * STATES + i] = x[i] + SPREAD * root[i * STATES + k];
            points[(1 + STATES + k) * STATES + i] = x[i] - SPREAD * root[i * STATES + k];
        }
    }
}

/* The weight of a point in covariances. */
static real weight(int k)
{
    return k == 0 ? WEIGHT_OF_CENTRE : WEIGHT_OF_OTHERS;
}

/* Points of some size beside their mean. */
static void centre(real *points, int size, real *mean)
{
    for (int i = 0; i < size; i++) {
        mean[i] = R(0.0);
    }
    for (int k = 0; k < POINTS; k++) {
        for (int i = 0; i < size; i++) {
            mean[i] += (k == 0 ? WEIGHT_OF_MEAN : WEIGHT_OF_OTHERS) * points[k * size + i];
        }
    }
    for (int k = 0; k < POINTS; k++) {
        for (int i = 0; i < size; i++) {
            points[k * size + i] -= mean[i];
        }
    }
}

//? discrete
/* Points beside their mean do not differ in what has no deviation, by rounding either. */
static void still(real *points)
{
    for (int k = 0; k < POINTS; k++) {
        for (int i = 0; i < DISCRETE; i++) {
            points[k * STATES + discrete_states[i]] = R(0.0);
        }
    }
}

//?
//? moving
/* The lower root of the sum of squares of some rows, which are used up, without a column for states that do not differ:
   what stands there else depends on rounding, and so would the points. */
static void root_of_moving(real *rows, int count, real *root)
{
    real packed[STATES * STATES];
    int places[STATES];
    int moving = 0;
    for (int i = 0; i < STATES; i++) {
        truth is_moving = 0;
        for (int r = 0; r < count; r++) {
            if (rows[r * STATES + i] < R(0.0) || rows[r * STATES + i] > R(0.0)) {
                is_moving = 1;
            }
        }
        places[i] = 0;
        if (is_moving) {
            places[moving] = i;
            moving++;
        }
    }
    for (int r = 0; r < count; r++) {
        for (int i = 0; i < STATES; i++) {
            rows[r * STATES + i] = i < moving ? rows[r * STATES + places[i]] : R(0.0);
        }
    }
    root_of_rows(rows, count, packed);
    for (int i = 0; i < STATES * STATES; i++) {
        root[i] = R(0.0);
    }
    for (int i = 0; i < moving; i++) {
        for (int j = 0; j <= i; j++) {
            root[places[i] * STATES + places[j]] = packed[i * STATES + j];
        }
    }
}

//?
/* The lower root of the weighted sum of squares of the points, and of some rows more. */
static void root_of_points(const real *points, const real *extra, int count, real *root)
{
//? definite
    real rows[(POINTS + LARGER) * STATES];
    for (int k = 0; k < POINTS; k++) {
        for (int i = 0; i < STATES; i++) {
            rows[k * STATES + i] = sqrt(weight(k)) * points[k * STATES + i];
        }
    }
    for (int i = 0; i < count * STATES; i++) {
        rows[POINTS * STATES + i] = extra[i];
    }
    ROOT_OF_ROWS(rows, POINTS + count, root);
//?
//? !definite
    real sum[STATES * STATES];
    for (int i = 0; i < STATES; i++) {
        for (int j = 0; j < STATES; j++) {
            real entry = R(0.0);
            for (int k = 0; k < POINTS; k++) {
                entry += weight(k) * points[k * STATES + i] * points[k * STATES + j];
            }
            for (int k = 0; k < count; k++) {
                entry += extra[k * STATES + i] * extra[k * STATES + j];
            }
            sum[i * STATES + j] = entry;
        }
    }
    factorise(sum, STATES, root);
//?
}

//? rotations
/* The mean of points with quaternions, and the points beside it, in the plane that touches there. */
static void gather(real *points, real *x)
{
    real images[POINTS * STATES];
    real point[STATES];
    real about[STATES];
    for (int k = 0; k < POINTS; k++) {
        for (int i = 0; i < STATES; i++) {
            point[i] = points[k * STATES + i];
        }
        for (int r = 0; r < ROTATIONS; r++) {
            normalise(point, rotation_places[r]);
        }
        for (int i = 0; i < STATES; i++) {
            images[k * STATES + i] = point[i];
        }
    }
    for (int i = 0; i < STATES; i++) {
        about[i] = images[i];
    }
    real moved = R(1.0);
    int step = 0;
    while (step < 30 && moved >= R(1e-13)) {
        step++;
        for (int k = 0; k < POINTS; k++) {
            for (int i = 0; i < STATES; i++) {
                point[i] = images[k * STATES + i];
            }
            flatten(about, point);
            for (int i = 0; i < STATES; i++) {
                points[k * STATES + i] = point[i];
            }
        }
        centre(points, STATES, x);
        moved = R(0.0);
        for (int r = 0; r < ROTATIONS; r++) {
            for (int i = 0; i < 4; i++) {
                const real off = fabs(x[rotation_places[r] + i] - about[rotation_places[r] + i]);
                moved = off > moved ? off : moved;
            }
        }
        retract(about, x);
        for (int i = 0; i < STATES; i++) {
            about[i] = x[i];
        }
    }
}

//?
/* Each point through the flow; P is their spread and W. 0, and nothing changed, where the flow has no value. */
static truth predict(field f, double from, double to, int steps, const real *w, real *x, real *rootMEMORY_PARAMETER)
{
    real points[POINTS * STATES];
    real point[STATES];
    real extra[STATES * STATES];
//? events
    /* each point meets events of its own, beside what the estimate remembers, and as many */
    double remembered[MEMORY];
    double own[MEMORY];
    m[HAPPENED] = 0.0;
    for (int i = 0; i < MEMORY; i++) {
        remembered[i] = m[i];
    }
//?
    for (int i = 0; i < STATES * STATES; i++) {
        extra[i] = R(0.0);
    }
    draw(x, root, points);
//? rotations
    for (int k = 0; k < POINTS; k++) {
        for (int i = 0; i < STATES; i++) {
            point[i] = points[k * STATES + i];
        }
        retract(x, point);
        for (int i = 0; i < STATES; i++) {
            points[k * STATES + i] = point[i];
        }
    }
//?
//? noisy
    /* the estimate with what the process noise comes to along it */
    real z[DIMENSION];
    if (!along(linearised, from, to, steps, w, x, zMEMORY_ARGUMENT)) {
        return 0;
    }
    rows_of_noise(z, w, extra);
    for (int i = 0; i < STATES; i++) {
        points[i] = z[i];
    }
//?
    for (int k = FIRST; k < POINTS; k++) {
        for (int i = 0; i < STATES; i++) {
            point[i] = points[k * STATES + i];
        }
//? !events
        if (!integrate_point(f, from, to, steps, w, point)) {
            return 0;
        }
//?
//? events
        for (int i = 0; i < MEMORY; i++) {
            own[i] = remembered[i];
        }
        own[ALLOWED] = k == 0 ? -1.0 : m[HAPPENED];
        if (!integrate_point(f, from, to, steps, w, point, own)) {
            m[ENDLESS] = own[ENDLESS];
            return 0;
        }
        if (k == 0) {
            for (int i = 0; i < MEMORY; i++) {
                m[i] = own[i];
            }
        }
        double missing = m[HAPPENED] - own[HAPPENED];
        while (missing > 0.5) {
            missing -= 1.0;
            if (!anticipate(f, to, to - from, w, point, own)) {
                m[ENDLESS] = own[ENDLESS];
                return 0;
            }
        }
//?
        for (int i = 0; i < STATES; i++) {
            points[k * STATES + i] = point[i];
        }
//? discrete
        /* what has no deviation is what it is of the estimate */
        for (int i = 0; i < DISCRETE; i++) {
            points[k * STATES + discrete_states[i]] = points[discrete_states[i]];
        }
//?
    }
//? discrete
    real at_rest[DISCRETE];
    for (int i = 0; i < DISCRETE; i++) {
        at_rest[i] = points[discrete_states[i]];
    }
//?
//? !rotations
    centre(points, STATES, x);
//?
//? rotations
    gather(points, x);
//?
//? discrete
    for (int i = 0; i < DISCRETE; i++) {
        x[discrete_states[i]] = at_rest[i];
    }
    still(points);
//?
    root_of_points(points, extra, STATES, root);
    return 1;
}

/* x with L L' x = b, from b in place; components that L does not reach are 0. */
static void substitute(const real *lower, int n, real *b)
{
    for (int i = 0; i < n; i++) {
        const real known = dot(lower, i * n, b, 0, i);
        b[i] = lower[i * n + i] > R(0.0) ? (b[i] - known) / lower[i * n + i] : R(0.0);
    }
    for (int i = n - 1; i >= 0; i--) {
        real known = R(0.0);
        for (int j = i + 1; j < n; j++) {
            known += lower[j * n + i] * b[j];
        }
        b[i] = lower[i * n + i] > R(0.0) ? (b[i] - known) / lower[i * n + i] : R(0.0);
    }
}

/* Points drawn again beside their mean, and what the sensors show of them beside theirs, h. 0 where
   the sensors' model has no value. */
static truth show(STATE *s, double t, BEFORE_PARAMETERreal *points, real *shown, real *h)
{
    real point[STATES];
    real mean[STATES];
    draw(s->x, s->root, points);
    for (int k = 0; k < POINTS; k++) {
        for (int i = 0; i < STATES; i++) {
            point[i] = points[k * STATES + i];
        }
//? rotations
        retract(before, point);
//?
        measure((real)t, point, s->inputs, h);
        for (int i = 0; i < SENSORS; i++) {
            if (!isfinite(h[i])) {
                return 0;
            }
//? !dials
            shown[k * SENSORS + i] = h[i];
//?
//? dials
            shown[k * SENSORS + i] = k == 0 ? h[i] : lifted(i, h[i], shown[i]);
//?
        }
    }
    centre(points, STATES, mean);
//? discrete
    still(points);
//?
    centre(shown, SENSORS, h);
    return 1;
}

/* The covariance of what two sensors show. */
static real shown_together(const real *shown, int i, int j)
{
    real sum = R(0.0);
    for (int k = 0; k < POINTS; k++) {
        sum += weight(k) * shown[k * SENSORS + i] * shown[k * SENSORS + j];
    }
    return sum;
}

/* The gain over the readings that are believed, together. 0 where the sensors' model has no
   value. */
static truth correct(STATE *s, double t)
{
    real points[POINTS * STATES];
    real shown[POINTS * SENSORS];
    real h[SENSORS];
    real noises[SENSORS];
    real innovations[SENSORS];
    truth believed[SENSORS];
    int taken[SENSORS];
    real variances[SENSORS * SENSORS];
    real lower[SENSORS * SENSORS];
    real row[SENSORS];
    real gain[STATES * SENSORS];
    real extra[SENSORS * STATES];
//? rotations
    real before[STATES];
    for (int i = 0; i < STATES; i++) {
        before[i] = s->x[i];
    }
//?
    if (!show(s, t, BEFORE_ARGUMENTpoints, shown, h)) {
        return 0;
    }
//? mirrors
    take_signs(s, h);
//?
    for (int i = 0; i < SENSORS; i++) {
        const real spread = shown_together(shown, i, i);
        believed[i] = judge(s, i, s->readings[i], h[i], spread, noises);
        if (!(spread + noises[i] > R(0.0))) {
            believed[i] = 0;
        }
    }
//? limits
    /* first all that are inside the ranges of their sensors, then those at an end one by one */
    truth is_moved = 0;
//?
    for (int round = 0; round < ROUNDS; round++) {
        int count = 0;
        for (int i = 0; i < SENSORS; i++) {
//? limits
            const real end = end_of(i, s->readings[i]);
            if (end != R(0.0) && round != i + 1) {
                continue;
            }
            if (believed[i] != 0 && end != R(0.0)) {
                real weighed[2];
                if (is_moved) {
                    if (!show(s, t, BEFORE_ARGUMENTpoints, shown, h)) {
                        return 1;
                    }
                }
                const real rest = shown_of(i, s->readings[i]) - h[i];
                const real spread = shown_together(shown, i, i);
                if (weigh(end, rest, spread, noises[i], weighed)) {
                    taken[count] = i;
                    innovations[count] = weighed[0];
                    noises[i] = weighed[1];
                    count++;
                }
                continue;
            }
//?
            if (believed[i] != 0 && round == 0) {
                taken[count] = i;
                innovations[count] = READING_SHOWN - h[i];
                count++;
            }
        }
        /* there are no more than SENSORS, which compilers do not see */
        if (count == 0 || count > SENSORS) {
            continue;
        }
//? limits
        is_moved = 1;
//?
        for (int a = 0; a < count; a++) {
            for (int b = 0; b < count; b++) {
                const real both = shown_together(shown, taken[a], taken[b]);
                variances[a * count + b] = a == b ? both + noises[taken[a]] : both;
            }
        }
        factorise(variances, count, lower);
        for (int i = 0; i < STATES; i++) {
            for (int a = 0; a < count; a++) {
                row[a] = R(0.0);
                for (int k = 0; k < POINTS; k++) {
                    row[a] += weight(k) * points[k * STATES + i] * shown[k * SENSORS + taken[a]];
                }
            }
            substitute(lower, count, row);
            real moved = R(0.0);
            for (int a = 0; a < count; a++) {
                gain[i * SENSORS + a] = row[a];
                extra[a * STATES + i] = row[a] * sqrt(noises[taken[a]]);
                moved += row[a] * innovations[a];
            }
            s->x[i] += moved;
        }
        for (int k = 0; k < POINTS; k++) {
            for (int i = 0; i < STATES; i++) {
                for (int a = 0; a < count; a++) {
                    row[a] = shown[k * SENSORS + taken[a]];
                }
                points[k * STATES + i] -= dot(gain, i * SENSORS, row, 0, count);
            }
        }
        root_of_points(points, extra, count, s->root);
    }
    return 1;
}
