/* A copy on the heap, into *kept where that is one already. */
static int keep(const course *c, void **kept)
{
    if (*kept == NULL) {
        *kept = malloc(sizeof *c);
    }
    if (*kept == NULL) {
        return NO_MEMORY;
    }
    memcpy(*kept, c, sizeof *c);
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
        return "only inputs and start values can be set";
    case NOT_POSITIVE:
        return "expected a finite number above 0";
    case NOT_NOW:
        return "this cannot be done in the present mode";
    default:
        return "there is not enough memory";
    }
}
