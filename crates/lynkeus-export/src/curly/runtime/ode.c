/* Takes x along the flow while the inputs stay, in equal steps: 0, or a code, and then x is what
   it was. */
static int advance(double from, double to, const real *w, real *x)
{
    real z[DIMENSION];
    const int steps = steps_between(from, to);
    if (steps == 0) {
        return INTERVAL;
    }
    for (int i = 0; i < DIMENSION; i++) {
        z[i] = x[i];
    }
    if (!integrate(flow, from, to, steps, w, z)) {
        return NOT_FINITE;
    }
    for (int i = 0; i < DIMENSION; i++) {
        x[i] = z[i];
    }
    return 0;
}
