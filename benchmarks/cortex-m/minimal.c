/* The smallest program with an estimator: what it takes of a device's memory, libraries included. */
#include "case.h"

static STATE state;
static volatile REAL input[SIGNALS];
static volatile REAL output[ESTIMATES];

int main(void)
{
    REAL signals[SIGNALS];
    REAL estimates[ESTIMATES];
    INIT(&state);
    for (int row = 0; row < 2; row++) {
        for (int i = 0; i < SIGNALS; i++) {
            signals[i] = input[i];
        }
        (void)PUSH(&state, STEP * row, signals, estimates);
        for (int i = 0; i < ESTIMATES; i++) {
            output[i] = estimates[i];
        }
    }
    return 0;
}
