/* The largest difference of two outputs of the bench, over each column's largest value; 0 where
   all are equal to the bit. */
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { LONGEST = 65536, COLUMNS = 1024 };

static double largest[COLUMNS];
static double differs[COLUMNS];
static int is_equal = 1;

static double number(const char *digits)
{
    const uint64_t bits = strtoull(digits, NULL, 16);
    double value = 0.0;
    memcpy(&value, &bits, sizeof value);
    return value;
}

/* The next row; NULL at the end. */
static char *row(FILE *file, char *line)
{
    while (fgets(line, LONGEST, file) != NULL) {
        if (strncmp(line, "row ", 4) == 0) {
            return line + 4;
        }
    }
    return NULL;
}

int main(int count, char **files)
{
    static char first[LONGEST];
    static char second[LONGEST];
    double worst = 0.0;
    int rows = 0;
    FILE *a = count == 3 ? fopen(files[1], "r") : NULL;
    FILE *b = count == 3 ? fopen(files[2], "r") : NULL;
    if (a == NULL || b == NULL) {
        (void)fprintf(stderr, "expected two outputs of the bench\n");
        return 2;
    }
    for (;;) {
        char *x = row(a, first);
        char *y = row(b, second);
        if ((x == NULL) != (y == NULL)) {
            (void)fprintf(stderr, "%s and %s: not equally many rows\n", files[1], files[2]);
            return 2;
        }
        if (x == NULL) {
            break;
        }
        rows++;
        for (int i = 0; i < COLUMNS && *x != '\n' && *y != '\n'; i++) {
            const double p = number(x);
            const double q = number(y);
            largest[i] = fmax(largest[i], fabs(q));
            is_equal = is_equal && memcmp(&p, &q, sizeof p) == 0;
            differs[i] = isnan(p - q) ? (double)INFINITY : fmax(differs[i], fabs(p - q));
            x += strcspn(x, " \n");
            x += *x == ' ' ? 1 : 0;
            y += strcspn(y, " \n");
            y += *y == ' ' ? 1 : 0;
        }
    }
    for (int i = 0; i < COLUMNS; i++) {
        if (differs[i] > 0.0) {
            worst = fmax(worst, differs[i] / largest[i]);
        }
    }
    if (rows == 0) {
        (void)fprintf(stderr, "%s: no rows\n", files[1]);
        return 2;
    }
    (void)printf(is_equal ? "0\n" : "%.1e\n", worst);
    return 0;
}
