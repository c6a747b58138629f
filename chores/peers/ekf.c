/* An extended Kalman filter by hand: N cells in a chain, x_i' = flow(x_(i-1)) - flow(x_i), fed by u,
   the last one measured every 0.1; one Runge-Kutta step between samples, F's two bands used.

   root   the covariance as a root P = S S': Phi and W by Runge and Kutta, W's factor L, Householder's
          reflections of [L'; (Phi S)'], Carlson's update
   plain  P itself: P' = F P + P F' + Q by Runge and Kutta, P - K C P; one triangle of it

   ekf ROWS          seconds of a sample by both, and where they end (x, then deviations), as JSON
   ekf LOG RESULT    a log of t, u, y into estimates by the plain one, text to text */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#ifndef N
#define N 4
#endif
#define STEP 0.1
#define INPUT 0.7
#define DENSITY 1e-6
#define VARIANCE 4e-4
#define AT_REST 0.5
#ifndef WIDE
#define WIDE (N < 8 ? 4 : 8)
#endif
#define ROOM ((N + WIDE - 1) / WIDE * WIDE) /* rows are whole vectors */
#define LESS(a, b) ((a) < (b) ? (a) : (b))
typedef double row[ROOM] __attribute__((aligned(8 * WIDE)));

/* x' and the slopes of the flows: F has -slope_i on its diagonal and slope_(i-1) beside it */
static void field(const double *x, double u, double *dx, double *slope) {
    double in[N + 1];
    in[0] = u;
    for (int i = 0; i < N; i++) {
        double below = 1.0 + x[i] * 1.5;
        in[i + 1] = x[i] * 2.5 / below;
        slope[i] = 2.5 / (below * below);
    }
    for (int i = 0; i < N; i++) dx[i] = in[i] - in[i + 1];
}

static const double part[4] = {0.0, 0.5, 0.5, 1.0};

/* ---- the covariance itself ---- */

/* P' = F P + P F' + Q: the lower triangle */
static void spread(const double *g, row *P, row *D) {
    for (int i = 0; i < N; i++) {
        double own = g[i];
        if (i) {
            double before = g[i - 1];
            D[i][0] = before * P[i - 1][0] - (own + g[0]) * P[i][0];
            for (int j = 1; j < i; j++) {
                D[i][j] = before * P[i - 1][j] + g[j - 1] * P[i][j - 1] - (own + g[j]) * P[i][j];
            }
            D[i][i] = 2 * (before * P[i][i - 1] - own * P[i][i]) + DENSITY;
        } else {
            D[0][0] = -2 * own * P[0][0] + DENSITY;
        }
    }
}

static void plain_predict(double *x, row *P, double u, double h) {
    static row k[4], s, slope, K[4][N], S[N];
    field(x, u, k[0], slope);
    spread(slope, P, K[0]);
    for (int stage = 1; stage < 4; stage++) {
        double c = h * part[stage];
        for (int i = 0; i < N; i++) s[i] = x[i] + c * k[stage - 1][i];
        for (int i = 0; i < N; i++)
            for (int j = 0; j <= i; j++) S[i][j] = P[i][j] + c * K[stage - 1][i][j];
        field(s, u, k[stage], slope);
        spread(slope, S, K[stage]);
    }
    double c = h / 6;
    for (int i = 0; i < N; i++) x[i] += c * (k[0][i] + 2 * (k[1][i] + k[2][i]) + k[3][i]);
    for (int i = 0; i < N; i++)
        for (int j = 0; j <= i; j++)
            P[i][j] += c * (K[0][i][j] + 2 * (K[1][i][j] + K[2][i][j]) + K[3][i][j]);
}

static void plain_update(double *x, row *P, double y) {
    double rest = y - x[N - 1], variance = P[N - 1][N - 1] + VARIANCE;
    row last, gain;
    for (int i = 0; i < N; i++) {
        last[i] = P[N - 1][i];
        gain[i] = last[i] / variance;
        x[i] += gain[i] * rest;
    }
    for (int i = 0; i < N; i++)
        for (int j = 0; j <= i; j++) P[i][j] -= gain[i] * last[j];
}

/* ---- its root ---- */

/* Phi - I and W reach one place further in every stage: their bands, [distance][row] */
#define BANDS (N < 5 ? N : 5)

static void root_predict(double *x, row *S, double u, double h) {
    static row k[4], s, g, KP[4][5], KW[4][5], P[5], W[5], R[N], A[N];
    memset(P, 0, sizeof P);
    memset(W, 0, sizeof W);
    for (int i = 0; i < N; i++) P[0][i] = 1; /* the bands that a stage does not reach stay 0 */
    for (int stage = 0; stage < 4; stage++) {
        double c = h * part[stage];
        if (stage) {
            for (int i = 0; i < N; i++) s[i] = x[i] + c * k[stage - 1][i];
            for (int d = 0; d <= LESS(stage, BANDS - 1); d++)
                for (int i = d; i < N; i++) P[d][i] = (d == 0) + c * KP[stage - 1][d][i];
            for (int d = 0; d <= LESS(stage - 1, BANDS - 1); d++)
                for (int i = d; i < N; i++) W[d][i] = c * KW[stage - 1][d][i];
        }
        field(stage ? s : x, u, k[stage], g);
        /* (F Phi)[i][i-d] = g[i-1] Phi[i-1][i-d] - g[i] Phi[i][i-d] */
        for (int i = 0; i < N; i++) KP[stage][0][i] = -g[i] * P[0][i];
        for (int d = 1; d <= LESS(stage + 1, BANDS - 1); d++)
            for (int i = d; i < N; i++) KP[stage][d][i] = g[i - 1] * P[d - 1][i - 1] - g[i] * P[d][i];
        /* W[i][i-d]: F W + W F' + Q */
        KW[stage][0][0] = DENSITY - 2 * g[0] * W[0][0];
        for (int i = 1; i < N; i++) KW[stage][0][i] = 2 * (g[i - 1] * W[1][i] - g[i] * W[0][i]) + DENSITY;
        for (int d = 1; d <= LESS(stage, BANDS - 1); d++) {
            KW[stage][d][d] = g[d - 1] * W[d - 1][d - 1] - (g[d] + g[0]) * W[d][d];
            for (int i = d + 1; i < N; i++)
                KW[stage][d][i] = g[i - 1] * W[d - 1][i - 1] + (d < 4 ? g[i - d - 1] * W[d + 1][i] : 0)
                                  - (g[i] + g[i - d]) * W[d][i];
        }
    }
    double c = h / 6;
    for (int i = 0; i < N; i++) x[i] += c * (k[0][i] + 2 * (k[1][i] + k[2][i]) + k[3][i]);
    for (int d = 0; d < BANDS; d++)
        for (int i = d; i < N; i++) {
            P[d][i] = (d == 0) + c * (KP[0][d][i] + 2 * (KP[1][d][i] + KP[2][d][i]) + KP[3][d][i]);
            W[d][i] = c * (KW[0][d][i] + 2 * (KW[1][d][i] + KW[2][d][i]) + KW[3][d][i]);
        }
    /* W = L L', three places beside the diagonal; rows of L' */
    for (int j = 0; j < N; j++) {
        double pivot = W[0][j];
        for (int m = j < 3 ? 0 : j - 3; m < j; m++) pivot -= R[m][j] * R[m][j];
        double q = sqrt(pivot);
        R[j][j] = q;
        for (int i = j + 1; i < LESS(j + 4, N); i++) {
            double rest = W[i - j][i];
            for (int m = i < 3 ? 0 : i - 3; m < j; m++) rest -= R[m][i] * R[m][j];
            R[j][i] = rest / q;
        }
    }
    /* (Phi S)', row m: from the m-th on; S is held by columns, S[m][i] = S_im */
    for (int m = 0; m < N; m++) {
        for (int i = 0; i < N; i++) A[m][i] = P[0][i] * S[m][i];
        for (int d = 1; d < BANDS; d++)
            for (int i = d; i < N; i++) A[m][i] += P[d][i] * S[m][i - d];
    }
    for (int k = 0; k < N; k++) {
        double square = R[k][k] * R[k][k];
        for (int m = 0; m <= k; m++) square += A[m][k] * A[m][k];
        double norm = sqrt(square), pivot = R[k][k], head = pivot > 0 ? -norm : norm;
        double first = pivot - head, over = 1 / (-head * first);
        row sums;
        int begin = (k + 1) / WIDE * WIDE; /* whole vectors: what stands left of k is not looked at again */
        for (int j = begin; j < ROOM; j++) sums[j] = first * R[k][j];
        for (int m = 0; m <= k; m++) {
            double v = A[m][k];
            for (int j = begin; j < ROOM; j++) sums[j] += v * A[m][j];
        }
        double factor = first * over, sign = head < 0 ? -1 : 1;
        for (int j = begin; j < ROOM; j++) S[k][j] = sign * (R[k][j] - factor * sums[j]);
        for (int m = 0; m <= k; m++) {
            factor = A[m][k] * over;
            for (int j = begin; j < ROOM; j++) A[m][j] -= factor * sums[j];
        }
        for (int j = begin; j < k; j++) S[k][j] = 0;
        S[k][k] = norm;
    }
}

static void root_update(double *x, row *S, double y) {
    double alpha = VARIANCE, rest = y - x[N - 1];
    row gain;
    memset(gain, 0, sizeof gain);
    for (int j = N - 1; j >= 0; j--) {
        double v = S[j][N - 1], before = alpha;
        alpha += v * v;
        double left = sqrt(before / alpha), taken = v / (sqrt(before) * sqrt(alpha));
        for (int i = j / WIDE * WIDE; i < ROOM; i++) {
            double own = S[j][i];
            S[j][i] = own * left - gain[i] * taken;
            gain[i] += own * v;
        }
    }
    for (int i = 0; i < N; i++) x[i] += gain[i] / alpha * rest;
}

/* ---- both over a log ---- */

static double now(void) {
    struct timespec t;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return t.tv_sec + 1e-9 * t.tv_nsec;
}

static void print(const char *what, const double *x, const double *deviations) {
    printf(", \"%s\": [", what);
    for (int i = 0; i < N; i++) printf("%.17g, ", x[i]);
    for (int i = 0; i < N; i++) printf("%.17g%s", deviations[i], i + 1 < N ? ", " : "]");
}

static double by_root(const double *y, long rows, double *x, double *deviations) {
    static row S[N];
    memset(S, 0, sizeof S);
    for (int i = 0; i < N; i++) {
        x[i] = AT_REST;
        S[i][i] = 1e-2;
    }
    double begun = now();
    root_update(x, S, y[0]);
    for (long k = 1; k < rows; k++) {
        root_predict(x, S, INPUT, STEP);
        root_update(x, S, y[k]);
    }
    double seconds = now() - begun;
    for (int i = 0; i < N; i++) {
        double sum = 0;
        for (int m = 0; m <= i; m++) sum += S[m][i] * S[m][i];
        deviations[i] = sqrt(sum);
    }
    return seconds / rows;
}

static void begin(double *x, row *P) {
    memset(P, 0, N * sizeof *P);
    for (int i = 0; i < N; i++) {
        x[i] = AT_REST;
        P[i][i] = 1e-4;
    }
}

static double by_plain(const double *y, long rows, double *x, double *deviations) {
    static row P[N];
    begin(x, P);
    double begun = now();
    plain_update(x, P, y[0]);
    for (long k = 1; k < rows; k++) {
        plain_predict(x, P, INPUT, STEP);
        plain_update(x, P, y[k]);
    }
    double seconds = now() - begun;
    for (int i = 0; i < N; i++) deviations[i] = sqrt(P[i][i]);
    return seconds / rows;
}

static int copy(const char *from, const char *to) {
    static row P[N];
    row x;
    FILE *in = fopen(from, "r"), *out = fopen(to, "w");
    char line[256];
    double before = 0;
    if (!in || !out || !fgets(line, sizeof line, in)) return 1;
    fputs("t", out);
    for (int i = 0; i < N; i++) fprintf(out, ",x[%d]_hat", i + 1);
    fputc('\n', out);
    begin(x, P);
    for (long k = 0; fgets(line, sizeof line, in); k++) {
        char *rest;
        double t = strtod(line, &rest), u = strtod(rest + 1, &rest), y = strtod(rest + 1, &rest);
        if (k) plain_predict(x, P, u, t - before);
        plain_update(x, P, y);
        before = t;
        fprintf(out, "%.12g", t);
        for (int i = 0; i < N; i++) fprintf(out, ",%.12g", x[i]);
        fputc('\n', out);
    }
    return fclose(out) != 0;
}

int main(int count, char **arguments) {
    if (count == 3) return copy(arguments[1], arguments[2]);
    long rows = count > 1 ? atol(arguments[1]) : 10000;
    double *y = malloc(rows * sizeof *y), root = INFINITY, plain = INFINITY;
    row x, z, sx, sz;
    for (long k = 0; k < rows; k++) y[k] = 0.5 + 0.1 * sin(STEP * k);
    for (int turn = 0; turn < 10; turn++) {
        root = fmin(root, by_root(y, rows, x, sx));
        plain = fmin(plain, by_plain(y, rows, z, sz));
    }
    printf("{\"root\": %g, \"plain\": %g", root, plain);
    print("by transition", x, sx);
    print("by covariance", z, sz);
    puts("}");
    return 0;
}
