#include "@NAME@.h"

#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

/* Where FMUs are linked together, each has functions with names of its own: compile with
   -D@FMI@_FUNCTION_PREFIX=@NAME@_, which the headers of the standard know, too. */
#if defined(@FMI@_FUNCTION_PREFIX) && !defined(@FMI@_OVERRIDE_FUNCTION_PREFIX)
#define @FMI@_ACTUAL_FUNCTION_PREFIX @FMI@_FUNCTION_PREFIX
#endif
#if defined(@FMI@_ACTUAL_FUNCTION_PREFIX)
#define JOINED(a, b) a##b
#define PREFIXED(prefix, name) JOINED(prefix, name)
#define FULL(name) PREFIXED(@FMI@_ACTUAL_FUNCTION_PREFIX, name)
#define API
#else
#define FULL(name) name
#if defined(_WIN32)
#define API __declspec(dllexport)
#elif defined(__GNUC__)
#define API __attribute__((visibility("default")))
#else
#define API
#endif
#endif

/* What can go wrong besides the codes of @NAME@.h, which are above 0. */
enum { NO_VALUE = -1, NOT_SETTABLE = -2, NOT_NOW = -3, NO_MEMORY = -4, NOT_POSITIVE = -5, NOT_OURS = -6, NOT_HERE = -7, NO_PLACE = -8 };

static const char token[] = "@TOKEN@";

/* Where an instance is between instantiation and its end; calls have their modes. */
enum { INSTANTIATED = 1, INITIALIZATION = 2, RUNNING = 4, TERMINATED = 8 };
enum {
    BEFORE = INSTANTIATED | INITIALIZATION,
    SINCE = INITIALIZATION | RUNNING | TERMINATED,
    ANY = BEFORE | SINCE
};
