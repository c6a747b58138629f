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
    root_of_rows(rows, POINTS + count, root);
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

/* Each point through the flow. 0, and nothing changed, where the flow has no value. */
static truth predict(field f, double from, double to, int steps, const real *w, real *x, real *root)
{
    real points[POINTS * STATES];
    real point[STATES];
    real extra[STATES * STATES];
    draw(x, root, points);
    for (int k = 0; k < POINTS; k++) {
        for (int i = 0; i < STATES; i++) {
            point[i] = points[k * STATES + i];
        }
        if (!integrate(f, from, to, steps, w, point)) {
            return 0;
        }
        for (int i = 0; i < STATES; i++) {
            points[k * STATES + i] = point[i];
        }
    }
    for (int i = 0; i < STATES * STATES; i++) {
        extra[i] = R(0.0);
    }
    const double span = to - from;
    for (int i = 0; i < STATES; i++) {
        extra[i * STATES + i] = sqrt(process_noise[i] * (real)span);
    }
    centre(points, STATES, x);
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

/* Points drawn again; the gain over the readings that are believed. 0 where the sensors' model has
   no value. */
static truth correct(STATE *s, double t)
{
    real points[POINTS * STATES];
    real point[STATES];
    real shown[POINTS * SENSORS];
    real h[SENSORS];
    real mean[STATES];
    real noises[SENSORS];
    real innovations[SENSORS];
    int taken[SENSORS];
    real variances[SENSORS * SENSORS];
    real lower[SENSORS * SENSORS];
    real row[SENSORS];
    real gain[STATES * SENSORS];
    real extra[SENSORS * STATES];
    int count = 0;
    draw(s->x, s->root, points);
    for (int k = 0; k < POINTS; k++) {
        for (int i = 0; i < STATES; i++) {
            point[i] = points[k * STATES + i];
        }
        measure((real)t, point, s->inputs, h);
        for (int i = 0; i < SENSORS; i++) {
            if (!isfinite(h[i])) {
                return 0;
            }
            shown[k * SENSORS + i] = h[i];
        }
    }
    centre(points, STATES, mean);
    centre(shown, SENSORS, h);
    for (int i = 0; i < SENSORS; i++) {
        real variance = R(0.0);
        for (int k = 0; k < POINTS; k++) {
            variance += weight(k) * shown[k * SENSORS + i] * shown[k * SENSORS + i];
        }
        const real noise = noise_variance(i, h[i]);
        variance += noise;
        if (judge(s, i, s->readings[i], h[i], variance) && variance > R(0.0)) {
            taken[count] = i;
            noises[count] = noise;
            innovations[count] = s->readings[i] - h[i];
            count++;
        }
    }
    if (count == 0) {
        return 1;
    }
    for (int a = 0; a < count; a++) {
        for (int b = 0; b < count; b++) {
            real variance = R(0.0);
            for (int k = 0; k < POINTS; k++) {
                variance += weight(k) * shown[k * SENSORS + taken[a]] * shown[k * SENSORS + taken[b]];
            }
            variances[a * count + b] = a == b ? variance + noises[a] : variance;
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
            extra[a * STATES + i] = row[a] * sqrt(noises[a]);
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
    return 1;
}
