/* Elementary functions of many numbers: seconds of a value, and the sum of all, as JSON.
   -ffast-math -lmvec   in vectors, by libmvec
   -fno-builtin         one by one, by libm */
#include <math.h>
#include <stdio.h>
#include <time.h>
#define COUNT 4096
#define ROUNDS 500
static double x[COUNT] __attribute__((aligned(64))), y[COUNT] __attribute__((aligned(64)));

static double now(void) {
    struct timespec t;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return t.tv_sec + 1e-9 * t.tv_nsec;
}

/* of numbers from `low` to `high`; the least of some turns */
#define MEASURE(name, value, low, high)                                                             \
    static void measure_##name(void) {                                                              \
        for (int i = 0; i < COUNT; i++) x[i] = (low) + ((high) - (low)) * (i + 0.5) / COUNT;        \
        double least = INFINITY, sum = 0;                                                           \
        for (int turn = 0; turn < 10; turn++) {                                                     \
            double begun = now();                                                                   \
            for (int round = 0; round < ROUNDS; round++) {                                          \
                for (int i = 0; i < COUNT; i++) y[i] = value;                                       \
                __asm__ volatile("" ::: "memory");                                                  \
            }                                                                                       \
            double seconds = now() - begun;                                                         \
            if (seconds < least) least = seconds;                                                   \
        }                                                                                           \
        for (int i = 0; i < COUNT; i++) sum += y[i];                                                \
        printf("\"%s\": %g, \"end of %s\": [%.17g], ", #name, least / COUNT / ROUNDS, #name, sum);  \
    }

MEASURE(exp, exp(x[i]), -20, 5)
MEASURE(log, log(x[i]), 1e-3, 1e3)
MEASURE(sin, sin(x[i]), -19, 20)
MEASURE(cos, cos(x[i]), -19, 20)
MEASURE(pow, pow(x[i], 1.7), 1e-2, 10)
MEASURE(tanh, tanh(x[i]), -3, 4)
MEASURE(atan2, atan2(x[i], 0.7), -3, 4)

int main(void) {
    printf("{");
    measure_exp();
    measure_log();
    measure_sin();
    measure_cos();
    measure_pow();
    measure_tanh();
    measure_atan2();
    printf("\"status\": 0}\n");
    return 0;
}
