/* Replays a log through the estimator: a table with a column t (time, where a signal is called t)
   and one for each signal, comma separated, from standard input; estimates to standard output. An
//? tunable
   empty cell is a sensor that did not report. Arguments NAME=VALUE change numbers of the estimator
   before the first row. */
//?
//? !tunable
   empty cell is a sensor that did not report. */
//?
#include "@NAME@.h"

#include <ctype.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { LONGEST = 65536, COLUMNS = 4096 };

static char line[LONGEST];
static char *cells[COLUMNS];

/* Splits a line at its commas; quotes around a cell are taken off. */
static int split(char *text)
{
    int count = 0;
    text[strcspn(text, "\r\n")] = '\0';
    for (char *cell = text; cell != NULL && count < COLUMNS;) {
        char *next = NULL;
        while (isspace((unsigned char)*cell)) {
            cell++;
        }
        if (*cell == '"') {
            char *end = strchr(cell + 1, '"');
            cell++;
            if (end != NULL) {
                *end = '\0';
                next = strchr(end + 1, ',');
            }
        } else {
            next = strchr(cell, ',');
        }
        if (next != NULL) {
            *next = '\0';
            next++;
        }
        cells[count] = cell;
        count++;
        cell = next;
    }
    return count;
}

/* The next line; -1 where it is longer than there is room for, 0 at the end. */
static int next_line(void)
{
    size_t length;
    if (fgets(line, LONGEST, stdin) == NULL) {
        return 0;
    }
    length = strlen(line);
    if (length == LONGEST - 1 && line[length - 1] != '\n') {
        const int next = getchar();
        if (next != EOF) {
            return -1;
        }
    }
    return 1;
}

static int column(const char *name, int count)
{
    for (int i = 0; i < count; i++) {
        if (strcmp(cells[i], name) == 0) {
            return i;
        }
    }
    return -1;
}

/* A cell as a number, NAN where it is empty. 0 where it is something else. */
static int number(int place, int count, double *value)
{
    char *end = NULL;
    *value = (double)NAN;
    if (place >= count || cells[place][0] == '\0') {
        return 1;
    }
    *value = strtod(cells[place], &end);
    while (*end == ' ') {
        end++;
    }
    return end != cells[place] && *end == '\0';
}

//? tunable
/* NAME=VALUE; 0 where there is no such name, or no value. */
static int changed(@NAME@_state *s, const char *argument)
{
    const char *value = strrchr(argument, '=');
    for (int i = 0; value != NULL && i < @CAPITALS@_TUNABLES; i++) {
        const size_t length = strlen(@NAME@_tunable_names[i]);
        if (length == (size_t)(value - argument) && strncmp(argument, @NAME@_tunable_names[i], length) == 0) {
            char *end = NULL;
            s->tuning[i] = (@REAL@)strtod(value + 1, &end);
            return end != value + 1 && *end == '\0';
        }
    }
    return 0;
}

int main(int argument_count, char **arguments)
{
//?
//? !tunable
int main(void)
{
//?
    static @NAME@_state state;
    int places[@CAPITALS@_SIGNALS];
    @REAL@ signals[@CAPITALS@_SIGNALS];
    @REAL@ estimates[@CAPITALS@_ESTIMATES];
    const char *time_name = "t";
    int time = -1;
    int wrong = -1;
    int count = 0;
    long row = 1;

    int has_line = next_line();

    if (has_line == 0) {
        (void)fprintf(stderr, "expected a table on standard input, found nothing\n");
        return 2;
    }
    if (has_line < 0) {
        (void)fprintf(stderr, "row %ld: expected at most %d bytes, found more\n", row, LONGEST - 1);
        return 2;
    }
    count = split(line);
    for (int i = 0; i < @CAPITALS@_SIGNALS; i++) {
        if (strcmp(@NAME@_signal_names[i], "t") == 0) {
            time_name = "time";
        }
    }
    time = column(time_name, count);
    if (time < 0) {
        (void)fprintf(stderr, "expected a column %s\n", time_name);
        return 2;
    }
    for (int i = 0; i < @CAPITALS@_SIGNALS; i++) {
        places[i] = column(@NAME@_signal_names[i], count);
        if (places[i] < 0) {
            (void)fprintf(stderr, "expected a column %s\n", @NAME@_signal_names[i]);
            return 2;
        }
    }
    (void)printf("%s", time_name);
    for (int i = 0; i < @CAPITALS@_ESTIMATES; i++) {
        const int is_quoted = strchr(@NAME@_estimate_names[i], ',') != NULL;
        (void)printf(is_quoted ? ",\"%s\"" : ",%s", @NAME@_estimate_names[i]);
    }
    (void)printf("\n");
    @NAME@_init(&state);
//? tunable
    for (int i = 1; i < argument_count; i++) {
        if (!changed(&state, arguments[i])) {
            (void)fprintf(stderr, "expected NAME=VALUE of a number in @NAME@.h, found %s\n", arguments[i]);
            return 2;
        }
    }
//?
    for (has_line = next_line(); has_line != 0; has_line = next_line()) {
        int code = 0;
        double t = 0.0;
        row++;
        if (has_line < 0) {
            (void)fprintf(stderr, "row %ld: expected at most %d bytes, found more\n", row, LONGEST - 1);
            return 2;
        }
        count = split(line);
        if (count == 1 && cells[0][0] == '\0') {
            continue;
        }
        wrong = number(time, count, &t) ? -1 : time;
        for (int i = 0; i < @CAPITALS@_SIGNALS; i++) {
            double value = (double)NAN;
            if (!number(places[i], count, &value) && wrong < 0) {
                wrong = places[i];
            }
            signals[i] = (@REAL@)value;
        }
        if (wrong >= 0) {
            (void)fprintf(stderr, "row %ld: expected a number, found %s\n", row, cells[wrong]);
            return 2;
        }
        code = @NAME@_push(&state, t, signals, estimates);
        if (code != 0) {
            (void)fprintf(stderr, "row %ld, t = %.17g: code %d, see @NAME@.h\n", row, t, code);
            return 1;
        }
        (void)printf("%.17g", t);
        for (int i = 0; i < @CAPITALS@_ESTIMATES; i++) {
            (void)printf(",%.17g", (double)estimates[i]);
        }
        (void)printf("\n");
    }
    return 0;
}
