#include "@NAME@.h"

#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#if defined(_WIN32)
#define API __declspec(dllexport)
#elif defined(__GNUC__)
#define API __attribute__((visibility("default")))
#else
#define API
#endif

/* What can go wrong besides the codes of @NAME@.h, which are above 0. */
enum { NO_VALUE = -1, NOT_SETTABLE = -2, NOT_NOW = -3, NO_MEMORY = -4, NOT_POSITIVE = -5, NOT_OURS = -6 };

static const char token[] = "@TOKEN@";

