/* Lee's example with its observer (8 states) in vector lanes: seconds of one step, as JSON.
   -O3 -mavx2                           one input for all lanes
   -O3 -mavx2 -ffast-math -DOWN -lmvec  sin and exp in every lane, by libmvec */
#include <math.h>
#include <stdio.h>
#include <time.h>
#define LANES 64
#define field(t, x1, x2, x3, x4, z1, z2, z3, z4, u, e, d)                                           \
    do {                                                                                            \
        double i1 = x1 - z1, i2 = x3 - z3;                                                          \
        double a = u * 0.01, b = 1 - z1 * z1, c = z2 * 0.01 * e, q = 1 - z3 * z3;                   \
        double g1 = 6 + (a + b), g2 = 9 + (a * a + (-1 + z2 * (-2 * z1)) - a * (a + b));            \
        double g3 = 18 + (q + c), g4 = 81 + (-1 + z4 * (-2 * z3) + c * c - c * (q + c));            \
        d[0] = x2 + 0.01 * x1 * u;                                                                  \
        d[1] = -x1 + (1 - x1 * x1) * x2 + x3 * u;                                                   \
        d[2] = x4 + 0.01 * x2 * x3 * e;                                                             \
        d[3] = -x3 + (1 - x3 * x3) * x4 + u;                                                        \
        d[4] = z2 + 0.01 * z1 * u + g1 * i1;                                                        \
        d[5] = -z1 + b * z2 + z3 * u + g2 * i1 + u * i2;                                            \
        d[6] = z4 + 0.01 * z2 * z3 * e + g3 * i2;                                                   \
        d[7] = -z3 + q * z4 + u + g4 * i2;                                                          \
    } while (0)

static void step(double (*restrict x)[LANES], const double *restrict phase, double t, double h) {
    (void)phase; /* of OWN */
#ifndef OWN
    double u1 = 2 * sin(3 * t), e1 = exp(u1), u2 = 2 * sin(3 * (t + h / 2)), e2 = exp(u2);
    double u3 = 2 * sin(3 * (t + h)), e3 = exp(u3);
#endif
    for (int l = 0; l < LANES; l++) {
#ifdef OWN
        double p = phase[l];
        double u1 = 2 * sin(3 * t + p), e1 = exp(u1), u2 = 2 * sin(3 * (t + h / 2) + p), e2 = exp(u2);
        double u3 = 2 * sin(3 * (t + h) + p), e3 = exp(u3);
#endif
        double y[8], s[8], k1[8], k2[8], k3[8], k4[8];
        for (int i = 0; i < 8; i++) y[i] = x[i][l];
        field(t, y[0], y[1], y[2], y[3], y[4], y[5], y[6], y[7], u1, e1, k1);
        for (int i = 0; i < 8; i++) s[i] = y[i] + h / 2 * k1[i];
        field(t, s[0], s[1], s[2], s[3], s[4], s[5], s[6], s[7], u2, e2, k2);
        for (int i = 0; i < 8; i++) s[i] = y[i] + h / 2 * k2[i];
        field(t, s[0], s[1], s[2], s[3], s[4], s[5], s[6], s[7], u2, e2, k3);
        for (int i = 0; i < 8; i++) s[i] = y[i] + h * k3[i];
        field(t, s[0], s[1], s[2], s[3], s[4], s[5], s[6], s[7], u3, e3, k4);
        for (int i = 0; i < 8; i++) x[i][l] = y[i] + h / 6 * (k1[i] + 2 * (k2[i] + k3[i]) + k4[i]);
    }
}

int main(void) {
    int blocks = 4096 / LANES;
    static const double start[8] = {2, 1, 3, 3.5, .5, .5, .5, .5};
    static double x[8][LANES] __attribute__((aligned(64))), phase[LANES];
    double sum = 0, h = 1e-3;
    long steps = 5000;
    struct timespec a, b;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &a);
    for (int k = 0; k < blocks; k++) {
        for (int l = 0; l < LANES; l++) {
            for (int i = 0; i < 8; i++) x[i][l] = start[i];
            x[0][l] += 0.001 * (k * LANES + l);
            phase[l] = 0.01 * (k * LANES + l);
        }
        for (long j = 0; j < steps; j++) step(x, phase, j * h, h);
        sum += x[0][0] + x[4][LANES - 1];
    }
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &b);
    double seconds = (b.tv_sec - a.tv_sec) + 1e-9 * (b.tv_nsec - a.tv_nsec);
#ifdef OWN
    const char *figure = "own";
#else
    const char *figure = "batch";
#endif
    printf("{\"%s\": %g, \"end of %s\": [%.17g]}\n", figure, seconds / ((double)blocks * LANES * steps), figure, sum);
    return 0;
}
