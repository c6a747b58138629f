//= square
static real square(real a)
{
    return a * a;
}

//= sign
static real sign(real a)
{
    return a > R(0.0) ? R(1.0) : (a < R(0.0) ? R(-1.0) : a);
}

//= integer_power
static real integer_power(real a, int exponent)
{
    real power = R(1.0);
    real factor = a;
    int rest = exponent < 0 ? -exponent : exponent;
    while (rest > 0) {
        const int half = rest >> 1;
        if (rest - half - half == 1) {
            power *= factor;
        }
        factor *= factor;
        rest = half;
    }
    return exponent < 0 ? R(1.0) / power : power;
}

//= smaller
static real smaller(real a, real b)
{
    if (isnan(a) || isnan(b)) {
        return NAN;
    }
    return a < b || (a == b && signbit(a)) ? a : b;
}

//= larger
static real larger(real a, real b)
{
    if (isnan(a) || isnan(b)) {
        return NAN;
    }
    return b < a || (a == b && !signbit(a)) ? a : b;
}

//= solve
/* A x = b by Householder's reflections with a choice of columns; b becomes x, and after it comes
   an estimate of 1/cond(A). Directions that a is singular along are left out, so that x stays
   bounded. */
static void solve(int n, real *a, real *b)
{
    for (int k = 0; k < n; k++) {
        int pivot = k;
        real best = R(-1.0);
        for (int j = k; j < n; j++) {
            real norm = R(0.0);
            for (int i = k; i < n; i++) {
                norm += a[i * n + j] * a[i * n + j];
            }
            if (norm > best || j == k) {
                best = norm;
                pivot = j;
            }
        }
        for (int i = 0; i < n && pivot != k; i++) {
            const real entry = a[i * n + k];
            a[i * n + k] = a[i * n + pivot];
            a[i * n + pivot] = entry;
        }
        real scale = R(0.0);
        for (int i = k; i < n; i++) {
            const real size = fabs(a[i * n + k]);
            scale = size > scale ? size : scale;
        }
        if (scale != R(0.0)) {
            real norm = R(0.0);
            for (int i = k; i < n; i++) {
                const real entry = a[i * n + k] / scale;
                norm += entry * entry;
            }
            norm = scale * sqrt(norm);
            const real corner = a[k * n + k];
            const real alpha = corner > R(0.0) ? -norm : norm;
            const real first = corner / scale - alpha / scale;
            real own = first * corner;
            real vv = first * first;
            for (int i = k + 1; i < n; i++) {
                const real entry = a[i * n + k];
                own += entry / scale * entry;
                a[i * n + k] = entry / scale;
                vv += a[i * n + k] * a[i * n + k];
            }
            if (vv != R(0.0)) {
                a[k * n + k] -= R(2.0) * own / vv * first;
                for (int j = k + 1; j < n; j++) {
                    real sum = first * a[k * n + j];
                    for (int i = k + 1; i < n; i++) {
                        sum += a[i * n + k] * a[i * n + j];
                    }
                    a[k * n + j] -= R(2.0) * sum / vv * first;
                    for (int i = k + 1; i < n; i++) {
                        a[i * n + j] -= R(2.0) * sum / vv * a[i * n + k];
                    }
                }
                real sum = first * b[k];
                for (int i = k + 1; i < n; i++) {
                    sum += a[i * n + k] * b[i];
                }
                b[k] -= R(2.0) * sum / vv * first;
                for (int i = k + 1; i < n; i++) {
                    b[i] -= R(2.0) * sum / vv * a[i * n + k];
                }
            }
        }
        if (k + 1 < n) {
            a[(k + 1) * n + k] = (real)pivot;
        }
    }
    const real largest = fabs(a[0]);
    int rank = 0;
    while (rank < n && fabs(a[rank * n + rank]) > RANK * largest) {
        rank++;
    }
    for (int k = n - 1; k >= rank; k--) {
        b[k] = isnan(b[k]) || isnan(a[k * n + k]) ? NAN : R(0.0);
    }
    for (int k = rank - 1; k >= 0; k--) {
        real tail = R(0.0);
        for (int j = k + 1; j < n; j++) {
            tail += a[k * n + j] * b[j];
        }
        b[k] = (b[k] - tail) / a[k * n + k];
    }
    for (int k = n - 1; k >= 1; k--) {
        const int other = (int)a[k * n + k - 1];
        const real entry = b[k - 1];
        b[k - 1] = b[other];
        b[other] = entry;
    }
    const real ratio = largest > R(0.0) ? fabs(a[n * n - 1]) / largest : R(0.0);
    b[n] = ratio > R(1.0) ? R(1.0) : ratio;
}

//= power_of_two
/* The power of two of a number. */
static real power_of_two(real a)
{
    int exponent = 0;
    (void)frexp(a, &exponent);
    return ldexp(R(1.0), exponent - 1);
}

//= dot
/* Sum of a[i + k] b[j + k] over k. */
static real dot(const real *a, int i, const real *b, int j, int count)
{
    real sums[4];
    real tail = R(0.0);
    int k = 0;
    for (int lane = 0; lane < 4; lane++) {
        sums[lane] = R(0.0);
    }
    for (; k + 4 <= count; k += 4) {
        for (int lane = 0; lane < 4; lane++) {
            sums[lane] += a[i + k + lane] * b[j + k + lane];
        }
    }
    for (; k < count; k++) {
        tail += a[i + k] * b[j + k];
    }
    return sums[0] + sums[1] + sums[2] + sums[3] + tail;
}

//= deviation
/* The standard deviation of a state, for the lower root of its covariance. */
static real deviation(const real *root, int i)
{
    real sum = R(0.0);
    for (int k = 0; k < STATES; k++) {
        sum += root[i * STATES + k] * root[i * STATES + k];
    }
    return sqrt(sum);
}

//= triangularise
/* Reflections (Householder) that make some rows upper triangular, in units in which squares
   neither vanish nor overflow. */
static void triangularise(real *rows, int count)
{
    real sums[STATES];
    for (int k = 0; k < STATES && k < count; k++) {
        real largest = R(0.0);
        for (int i = k; i < count; i++) {
            const real size = fabs(rows[i * STATES + k]);
            if (!(size <= largest)) {
                largest = size;
            }
        }
        if (!(largest >= SMALLEST)) {
            continue;
        }
        const real unit = power_of_two(largest);
        real norm = R(0.0);
        for (int i = k; i < count; i++) {
            rows[i * STATES + k] /= unit;
            norm += rows[i * STATES + k] * rows[i * STATES + k];
        }
        norm = sqrt(norm);
        const real pivot = rows[k * STATES + k];
        const real head = pivot > R(0.0) ? -norm : norm;
        const real beta = -head * (pivot - head);
        rows[k * STATES + k] = pivot - head;
        for (int j = 0; j < STATES; j++) {
            sums[j] = R(0.0);
        }
        for (int i = k; i < count; i++) {
            const real v = rows[i * STATES + k];
            for (int j = k + 1; j < STATES; j++) {
                sums[j] += v * rows[i * STATES + j];
            }
        }
        for (int i = k; i < count; i++) {
            const real factor = rows[i * STATES + k] / beta;
            rows[i * STATES + k] = R(0.0);
            for (int j = k + 1; j < STATES; j++) {
                rows[i * STATES + j] -= factor * sums[j];
            }
        }
        rows[k * STATES + k] = head * unit;
    }
}

//= root_of_rows
/* The lower root of the sum of squares of some rows, which are used up. */
static void root_of_rows(real *rows, int count, real *root)
{
    triangularise(rows, count);
    for (int i = 0; i < STATES * STATES; i++) {
        root[i] = R(0.0);
    }
    for (int i = 0; i < STATES && i < count; i++) {
        const real sign_of_row = rows[i * STATES + i] < R(0.0) ? R(-1.0) : R(1.0);
        for (int j = i; j < STATES; j++) {
            root[j * STATES + i] = sign_of_row * rows[i * STATES + j];
        }
    }
}

//= factorise
/* Cholesky's lower factor of an n x n matrix that has no negative eigenvalue but by rounding: a
   pivot that rounding cannot tell from zero has none. */
static void factorise(const real *matrix, int n, real *lower)
{
    int begins[LARGER];
    for (int i = 0; i < n; i++) {
        int begin = i;
        for (int j = 0; j < i; j++) {
            if (begin == i && matrix[i * n + j] != R(0.0)) {
                begin = j;
            }
        }
        begins[i] = begin;
    }
    for (int i = 0; i < n * n; i++) {
        lower[i] = R(0.0);
    }
    for (int j = 0; j < n; j++) {
        const real own = dot(lower, j * n + begins[j], lower, j * n + begins[j], j - begins[j]);
        const real pivot = matrix[j * n + j] - own;
        if (!(pivot > (real)n * EPSILON * fabs(matrix[j * n + j]))) {
            continue;
        }
        lower[j * n + j] = sqrt(pivot);
        for (int i = j + 1; i < n; i++) {
            if (begins[i] <= j) {
                const int begin = begins[i] > begins[j] ? begins[i] : begins[j];
                const real known = dot(lower, i * n + begin, lower, j * n + begin, j - begin);
                lower[i * n + j] = (matrix[i * n + j] - known) / lower[j * n + j];
            }
        }
    }
}

//= project
/* S'c for row i of C. */
static void project(const real *root, const real *c, int i, real *projected)
{
    for (int k = 0; k < STATES; k++) {
        projected[k] = R(0.0);
    }
    for (int j = 0; j < STATES; j++) {
        for (int k = 0; k <= j; k++) {
            projected[k] += c[i * STATES + j] * root[j * STATES + k];
        }
    }
}

//= take_reading
/* Carlson's update by one reading y = c x + noise: the gain, and the root of what is left of P.
   projected is S'c. 0 where neither the reading nor the estimate has any variance. */
static truth take_reading(real *root, const real *projected, real variance_of_noise, real *gain)
{
    real left[STATES];
    real taken[STATES];
    const real variance = dot(projected, 0, projected, 0, STATES) + variance_of_noise;
    if (!(variance > R(0.0))) {
        return 0;
    }
    real alpha = variance_of_noise;
    for (int k = STATES - 1; k >= 0; k--) {
        const real before = alpha;
        alpha += projected[k] * projected[k];
        left[k] = R(1.0);
        taken[k] = R(0.0);
        if (alpha > R(0.0)) {
            left[k] = sqrt(before / alpha);
            if (before > R(0.0)) {
                taken[k] = projected[k] / (sqrt(before) * sqrt(alpha));
            }
        }
    }
    for (int i = 0; i < STATES; i++) {
        real sum = R(0.0);
        for (int k = i; k >= 0; k--) {
            const real own = root[i * STATES + k];
            root[i * STATES + k] = own * left[k] - sum * taken[k];
            sum += own * projected[k];
        }
        gain[i] = sum / variance;
    }
    return 1;
}

//= noise_variance
/* The variance of a sensor's noise where the model predicts a value. */
static real noise_variance(int i, real predicted)
{
    const real share = noise_shares[i] * predicted;
    return noise_variances[i] + share * share;
}

//= expected_noise
/* The variance of a sensor's noise where the model predicts a value with some variance. */
static real expected_noise(int i, real predicted, real spread)
{
    const real mean = predicted * predicted + (spread > R(0.0) ? spread : R(0.0));
    return noise_variances[i] + noise_shares[i] * noise_shares[i] * mean;
}

//= noise_after
/* The same given a reading that contradicts the prediction: of what that reading with that noise
   leaves of it. */
static real noise_after(int i, real reading, real predicted, real spread)
{
    const real share = noise_shares[i] * noise_shares[i];
    real low = R(0.0);
    real high = R(1.0);
    for (int k = 0; k < 60; k++) {
        const real gain = R(0.5) * (low + high);
        const real value = predicted + gain * (reading - predicted);
        const real noise = noise_variances[i] + share * (value * value + spread * (R(1.0) - gain));
        if (gain * (spread + noise) < spread) {
            low = gain;
        } else {
            high = gain;
        }
    }
    const real last = predicted + high * (reading - predicted);
    return noise_variances[i] + share * (last * last + spread * (R(1.0) - high));
}

//= end_of
/* The end of its sensor's range that a reading is at: -1.0, 1.0, or 0.0 for none. */
static real end_of(int i, real reading)
{
    if (reading >= highest[i]) {
        return R(1.0);
    }
    return reading <= lowest[i] ? R(-1.0) : R(0.0);
}

//= shown_of
/* A reading within the range of its sensor. */
static real shown_of(int i, real reading)
{
    const real capped = reading > highest[i] ? highest[i] : reading;
    return capped < lowest[i] ? lowest[i] : capped;
}

//= tail_beyond
/* A standard normal number beyond a: its mean, and how far that is beyond a. */
static void tail_beyond(real a, real *tail)
{
    const real size = fabs(a);
    const real density = R(0.3989422804014327) * exp(R(-0.5) * a * a);
    if (size < R(2.25)) {
        real term = a;
        real sum = a;
        for (int k = 1; k < 40; k++) {
            const int odd = 2 * k + 1;
            term *= a * a / (real)odd;
            sum += term;
        }
        tail[0] = density / (R(0.5) - density * sum);
        tail[1] = tail[0] - a;
    } else {
        real excess = R(0.0);
        for (int k = 0; k < 79; k++) {
            excess = (real)(79 - k) / (size + excess);
        }
        if (a > R(0.0)) {
            tail[0] = a + excess;
            tail[1] = excess;
        } else {
            tail[0] = density / (R(1.0) - density / (size + excess));
            tail[1] = tail[0] - a;
        }
    }
}

//= weigh
/* A reading at an end of its sensor's range as an ordinary one: its innovation, and the variance of
   its noise. 0 where it says nothing. */
static truth weigh(real side, real innovation, real spread, real noise, real *weighed)
{
    real tail[2];
    const real variance = spread + noise;
    if (!(variance > R(0.0))) {
        weighed[0] = innovation;
        weighed[1] = noise;
        return side * innovation > R(0.0) ? 1 : 0;
    }
    const real deviation = sqrt(variance);
    const real a = side * innovation / deviation;
    tail_beyond(a, tail);
    const real told = tail[0] * tail[1];
    if (!(told > R(1e-10))) {
        return 0;
    }
    const real more = R(1.0) / told - R(1.0);
    weighed[0] = side * deviation / tail[1];
    weighed[1] = noise + variance * (more > R(0.0) ? more : R(0.0));
    return 1;
}

//= widen
/* Widens what counts as a plausible value. */
static void widen(STATE *s, real value)
{
    const real size = fabs(value);
    if (size > s->scale) {
        s->scale = size;
    }
}

//= lifted
/* A reading of an angle as the nearest one to what is predicted, up to full turns. */
static real lifted(int i, real reading, real predicted)
{
    if (dials[i] == 0) {
        return reading;
    }
    const real off = reading - predicted;
    return predicted + (off + R(6.283185307179586) * floor(R(0.5) - off / R(6.283185307179586)));
}

//= in_turn
/* An angle in the turn that begins at another. */
static real in_turn(real angle, real from)
{
    return angle - R(6.283185307179586) * floor((angle - from) / R(6.283185307179586));
}

//= normalise
/* The quaternion that begins at a place as one of length 1. */
static void normalise(real *x, int q)
{
    const real squares = x[q] * x[q] + x[q + 1] * x[q + 1];
    const real length = sqrt(squares + x[q + 2] * x[q + 2] + x[q + 3] * x[q + 3]);
    if (length > R(0.0) && isfinite(length)) {
        for (int i = 0; i < 4; i++) {
            x[q + i] /= length;
        }
    }
}

//= restore
/* The lower root of the same covariance, after its rows were changed. */
static void restore(real *root)
{
    real rows[STATES * STATES];
    for (int i = 0; i < STATES; i++) {
        for (int k = 0; k < STATES; k++) {
            rows[k * STATES + i] = root[i * STATES + k];
        }
    }
    root_of_rows(rows, STATES, root);
}

//= settle
/* Quaternions back to length 1, and what is not known of them along the sphere. */
static void settle(real *x, real *root)
{
    for (int r = 0; r < ROTATIONS; r++) {
        const int q = rotation_places[r];
        normalise(x, q);
        for (int k = 0; k < STATES; k++) {
            real along = R(0.0);
            for (int i = 0; i < 4; i++) {
                along += x[q + i] * root[(q + i) * STATES + k];
            }
            for (int i = 0; i < 4; i++) {
                root[(q + i) * STATES + k] -= along * x[q + i];
            }
        }
    }
    restore(root);
}

//= retract
/* What was added to quaternions since before as a way along the sphere. */
static void retract(const real *before, real *x)
{
    for (int r = 0; r < ROTATIONS; r++) {
        const int q = rotation_places[r];
        real squares = R(0.0);
        for (int i = 0; i < 4; i++) {
            squares += (x[q + i] - before[q + i]) * (x[q + i] - before[q + i]);
        }
        const real size = sqrt(squares);
        const real cosine = size > R(0.0) ? cos(size) : R(1.0);
        const real share = size > R(0.0) ? sin(size) / size : R(1.0);
        for (int i = 0; i < 4; i++) {
            x[q + i] = cosine * before[q + i] + share * (x[q + i] - before[q + i]);
        }
        normalise(x, q);
    }
}

//= land
/* The same, with what is known of them carried over. */
static void land(const real *before, real *x, real *root)
{
    real way[4];
    real column[4];
    retract(before, x);
    for (int r = 0; r < ROTATIONS; r++) {
        const int q = rotation_places[r];
        for (int i = 0; i < 4; i++) {
            column[i] = before[q + i];
        }
        way[0] = x[q] * column[0] + x[q + 1] * column[1] + x[q + 2] * column[2] + x[q + 3] * column[3];
        way[1] = x[q + 1] * column[0] - x[q] * column[1] - x[q + 2] * column[3] + x[q + 3] * column[2];
        way[2] = x[q + 2] * column[0] - x[q] * column[2] + x[q + 1] * column[3] - x[q + 3] * column[1];
        way[3] = x[q + 3] * column[0] - x[q] * column[3] - x[q + 1] * column[2] + x[q + 2] * column[1];
        for (int k = 0; k < STATES; k++) {
            for (int i = 0; i < 4; i++) {
                column[i] = root[(q + i) * STATES + k];
            }
            root[q * STATES + k] = way[0] * column[0] - way[1] * column[1] - way[2] * column[2] - way[3] * column[3];
            root[(q + 1) * STATES + k] = way[0] * column[1] + way[1] * column[0] + way[2] * column[3] - way[3] * column[2];
            root[(q + 2) * STATES + k] = way[0] * column[2] - way[1] * column[3] + way[2] * column[0] + way[3] * column[1];
            root[(q + 3) * STATES + k] = way[0] * column[3] + way[1] * column[2] - way[2] * column[1] + way[3] * column[0];
        }
    }
    restore(root);
}

//= flatten
/* Quaternions of a point in the plane that touches the sphere at another. */
static void flatten(const real *about, real *x)
{
    for (int r = 0; r < ROTATIONS; r++) {
        const int q = rotation_places[r];
        real along = R(0.0);
        for (int i = 0; i < 4; i++) {
            along += about[q + i] * x[q + i];
        }
        const real side = along < R(0.0) ? R(-1.0) : R(1.0);
        real squares = R(0.0);
        for (int i = 0; i < 4; i++) {
            x[q + i] = side * x[q + i] - side * along * about[q + i];
            squares += x[q + i] * x[q + i];
        }
        const real sine = sqrt(squares);
        const real share = sine > R(0.0) ? atan2(sine, side * along) / sine : R(1.0);
        for (int i = 0; i < 4; i++) {
            x[q + i] = about[q + i] + share * x[q + i];
        }
    }
}

//= take_signs
/* Readings with the signs of what is expected, where a quaternion and its negative say the same. */
static void take_signs(STATE *s, const real *expected)
{
    for (int r = 0; r < MIRRORS; r++) {
        real along = R(0.0);
        for (int i = 0; i < SENSORS; i++) {
            if (mirror_of[i] == r && isfinite(s->readings[i])) {
                along += s->readings[i] * expected[i];
            }
        }
        for (int i = 0; i < SENSORS; i++) {
            if (mirror_of[i] == r && along < R(0.0)) {
                s->readings[i] = -s->readings[i];
            }
        }
    }
}
