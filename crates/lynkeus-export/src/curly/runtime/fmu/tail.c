/* All of them, or none where one is refused. */
static int write_values(course *c, const uint32_t *references, size_t count, const double *values)
{
    int code = 0;
    for (size_t i = 0; i < count && code == 0; i++) {
        code = refusal(c, references[i], values[i]);
    }
    for (size_t i = 0; i < count && code == 0; i++) {
        write_value(c, references[i], values[i]);
    }
    return code;
}

/* A copy on the heap, into *kept where that is one already. */
static int keep(const course *c, void **kept)
{
    if (kept == NULL) {
        return NO_PLACE;
    }
    if (*kept == NULL) {
        *kept = malloc(sizeof *c);
    }
    if (*kept == NULL) {
        return NO_MEMORY;
    }
    memcpy(*kept, c, sizeof *c);
    return 0;
}

/* Back to what was kept. */
static int restored(course *c, const void *kept)
{
    if (kept == NULL) {
        return NO_PLACE;
    }
    memcpy(c, kept, sizeof *c);
    return 0;
}

/* FNV-1a of 64 bits. */
static uint64_t checksum(const unsigned char *bytes, size_t size)
{
    uint64_t sum = 0xcbf29ce484222325u;
    for (size_t i = 0; i < size; i++) {
        sum = (sum ^ bytes[i]) * 0x100000001b3u;
    }
    return sum;
}

/* A state as bytes, between the token of the FMU that it is of and a checksum of both. */
enum { TOKEN = sizeof token - 1, CHECKED = TOKEN + sizeof(course), BYTES = CHECKED + sizeof(uint64_t) };

static int written(const course *c, void *bytes, size_t size)
{
    unsigned char *to = bytes;
    uint64_t sum = 0;
    if (c == NULL || to == NULL) {
        return NO_PLACE;
    }
    if (size != BYTES) {
        return NO_VALUE;
    }
    memcpy(to, token, TOKEN);
    memcpy(to + TOKEN, c, sizeof *c);
    sum = checksum(to, CHECKED);
    memcpy(to + CHECKED, &sum, sizeof sum);
    return 0;
}

static int taken(const void *bytes, size_t size, void **kept)
{
    const unsigned char *from = bytes;
    course saved;
    uint64_t sum = 0;
    if (from == NULL || kept == NULL) {
        return NO_PLACE;
    }
    if (size != BYTES || memcmp(from, token, TOKEN) != 0) {
        return NOT_OURS;
    }
    memcpy(&sum, from + CHECKED, sizeof sum);
    if (sum != checksum(from, CHECKED)) {
        return NOT_OURS;
    }
    memcpy(&saved, from + TOKEN, sizeof saved);
    return keep(&saved, kept);
}

static int measured(size_t *size)
{
    if (size == NULL) {
        return NO_PLACE;
    }
    *size = BYTES;
    return 0;
}

static int is_ours(const char *given)
{
    return given != NULL && strcmp(given, token) == 0;
}

static const char *reason(int code)
{
    switch (code) {
@REASONS@    case NO_VALUE:
        return "there is no variable of this type with such a value reference";
    case NOT_SETTABLE:
        return "only inputs, start values and parameters can be set";
    case NOT_OURS:
        return "these bytes are no state of this FMU";
    case NOT_POSITIVE:
        return "expected a finite number above 0";
    case NOT_HERE:
        return "a step begins at the time of the instance, where the last one ended";
    case NO_PLACE:
        return "expected a place, found NULL";
    case NOT_NOW:
        return "this cannot be done in the present mode";
    default:
        return "there is not enough memory";
    }
}
//? exchange

/* Whether the category of discarded calls is meant; without a list all are. */
static int has_discards(size_t count, const char *const *categories)
{
    int found = count == 0;
    for (size_t i = 0; i < count; i++) {
        found = found || strcmp(categories[i], "logStatusDiscard") == 0;
    }
    return found;
}
//?
