/* A log through an exported estimator: the estimates bit by bit, and what a sample costs.
   case.h, written by run.sh, names the estimator and holds the log. */
#include "case.h"
#include "device.h"

#include <string.h>

enum { WARM = 20, FEW = 1, MANY = 11 };

static STATE state;
static STATE copy;
static REAL estimates[ESTIMATES];
static REAL ignored[ESTIMATES];

static void write_unsigned(uint32_t value)
{
    char digits[11];
    int place = 10;
    digits[place] = '\0';
    do {
        place--;
        digits[place] = (char)('0' + value % 10u);
        value /= 10u;
    } while (value > 0u);
    device_write(&digits[place]);
}

static void write_figure(const char *name, uint32_t value)
{
    device_write(name);
    device_write(" ");
    write_unsigned(value);
    device_write("\n");
}

/* The bits of a number as a double. */
static void write_bits(double value)
{
    uint64_t bits = 0;
    char digits[17];
    memcpy(&bits, &value, sizeof bits);
    for (int place = 15; place >= 0; place--) {
        digits[place] = "0123456789abcdef"[bits & 15u];
        bits >>= 4;
    }
    digits[16] = '\0';
    device_write(digits);
}

/* Instructions of a sample some time later, from a copy of the estimator. */
static uint32_t cost(double later, const REAL *signals)
{
    copy = state;
    const double t = state.time + later;
    const uint32_t before = device_instructions();
    (void)PUSH(&copy, t, signals, ignored);
    return device_instructions() - before;
}

int main(void)
{
    uint32_t few = 0;
    uint32_t many = 0;
    uint32_t all = 0;
    uint32_t stack = 0;
    int failed = 0;
    uint32_t before = device_instructions();
    const uint32_t overhead = device_instructions() - before;

    before = device_instructions();
    const uint32_t spent = device_spend(100000);
    const uint32_t counted = device_instructions() - before - overhead;
    write_figure("expected", spent);
    write_figure("counted", counted);

    INIT(&state);
    for (int row = 0; row < ROWS && failed == 0; row++) {
        if (row >= WARM) {
            few += cost(FEW * STEP, signals[row]) - overhead;
            many += cost(MANY * STEP, signals[row]) - overhead;
        }
        device_paint_stack();
        before = device_instructions();
        failed = PUSH(&state, times[row], signals[row], estimates);
        const uint32_t used = device_instructions() - before - overhead;
        const uint32_t depth = device_used_stack();
        stack = depth > stack ? depth : stack;
        all += row >= WARM ? used : 0;
        device_write("row");
        for (int i = 0; i < ESTIMATES; i++) {
            device_write(" ");
            write_bits((double)estimates[i]);
        }
        device_write("\n");
    }
    write_figure("code", (uint32_t)failed);
    write_figure("push", all / (ROWS - WARM));
    write_figure("one", few / (ROWS - WARM));
    write_figure("step", (many - few) / (MANY - FEW) / (ROWS - WARM));
    write_figure("stack", stack);
    write_figure("state", sizeof(STATE));
    return 0;
}
