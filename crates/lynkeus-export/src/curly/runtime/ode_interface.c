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

int @NAME@_advance(double from, double to, const double *u, double *x)
{
    return to == from ? 0 : advance(from, to, u, x);
}
