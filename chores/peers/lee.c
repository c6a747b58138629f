/* Lee's example with its classical observer, 8 states, as one writes it by hand: seconds of one
   Runge-Kutta step, as JSON. With an argument: that many steps and nothing else. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

static void field(double t, const double *x, double *d) {
    double u = 2 * sin(3 * t), e = exp(u);
    d[0] = x[1] + 0.01 * x[0] * u;
    d[1] = -x[0] + (1 - x[0] * x[0]) * x[1] + x[2] * u;
    d[2] = x[3] + 0.01 * x[1] * x[2] * e;
    d[3] = -x[2] + (1 - x[2] * x[2]) * x[3] + u;
    const double *z = x + 4;
    double i1 = x[0] - z[0], i2 = x[2] - z[2];
    double a = u * 0.01, b = 1 - z[0] * z[0], c = z[1] * 0.01 * e, q = 1 - z[2] * z[2];
    double g1 = 6 + (a + b), g2 = 9 + (a * a + (-1 + z[1] * (-2 * z[0])) - a * (a + b));
    double g3 = 18 + (q + c), g4 = 81 + (-1 + z[3] * (-2 * z[2]) + c * c - c * (q + c));
    d[4] = z[1] + 0.01 * z[0] * u + g1 * i1;
    d[5] = -z[0] + b * z[1] + z[2] * u + g2 * i1 + u * i2;
    d[6] = z[3] + 0.01 * z[1] * z[2] * e + g3 * i2;
    d[7] = -z[2] + q * z[3] + u + g4 * i2;
}

static double run(long steps) {
    double x[8] = {2, 1, 3, 3.5, .5, .5, .5, .5}, k1[8], k2[8], k3[8], k4[8], s[8], h = 1e-3;
    for (long j = 0; j < steps; j++) {
        double t = j * h;
        field(t, x, k1);
        for (int i = 0; i < 8; i++) s[i] = x[i] + h / 2 * k1[i];
        field(t + h / 2, s, k2);
        for (int i = 0; i < 8; i++) s[i] = x[i] + h / 2 * k2[i];
        field(t + h / 2, s, k3);
        for (int i = 0; i < 8; i++) s[i] = x[i] + h * k3[i];
        field(t + h, s, k4);
        for (int i = 0; i < 8; i++) x[i] += h / 6 * (k1[i] + 2 * (k2[i] + k3[i]) + k4[i]);
    }
    return x[0] + x[4];
}

int main(int argc, char **argv) {
    if (argc > 1) {
        printf("%.17g\n", run(atol(argv[1])));
        return 0;
    }
    long steps = 2000000;
    struct timespec a, b;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &a);
    double end = run(steps);
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &b);
    double seconds = (b.tv_sec - a.tv_sec) + 1e-9 * (b.tv_nsec - a.tv_nsec);
    printf("{\"step\": %g, \"end\": [%.17g]}\n", seconds / steps, end);
    return 0;
}
