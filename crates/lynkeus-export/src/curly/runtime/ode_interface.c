void @NAME@_init(double *x)
{
@STARTS@}

void @NAME@_derivatives(double t, const double *x, const double *u, double *dx)
{
    flow(t, x, u, dx);
}

void @NAME@_outputs(double t, const double *x, const double *u, double *y)
{
    outputs(t, x, u, y);
}

void @NAME@_along(double t, const double *x, const double *u, const double *v, double *dx, double *y)
{
    enum { GIVEN = INPUTS + PARAMETERS, MOVING = 1 + STATES + INPUTS };
    double w[GIVEN + MOVING];
    for (int i = 0; i < GIVEN; i++) {
        w[i] = u[i];
    }
    for (int i = 0; i < MOVING; i++) {
        w[GIVEN + i] = v[i];
    }
    along(t, x, w, dx, y);
}

int @NAME@_advance(double from, double to, const double *u, double *xMEMORY_PARAMETER)
{
    return to == from ? 0 : advance(from, to, u, xMEMORY_ARGUMENT);
}
//? events

void @NAME@_begin(double *m, double *sides)
{
    for (int i = 0; i < MEMORY; i++) {
        m[i] = 0.0;
    }
    /* as many events as come */
    m[ALLOWED] = -1.0;
    for (int r = 0; r < RELATIONS; r++) {
        sides[r] = 0.0;
    }
}

int @NAME@_event(double t, const double *u, double *x, double *m, double *sides)
{
    return event(t, u, x, m, sides);
}

void @NAME@_indicators(double t, const double *x, const double *u, const double *sizes, const double *sides, double *z)
{
    indicators(t, x, u, sizes, sides, z);
}

int @NAME@_next_instant(const double *m, double *next)
{
    return next_instant(m, next);
}
//?
