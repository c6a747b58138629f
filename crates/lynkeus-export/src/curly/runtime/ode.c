/* Takes x along the flow while the inputs stay, in equal steps: 0, or a code, and then x is what
   it was. */
static int advance(double from, double to, const real *w, real *xMEMORY_PARAMETER)
{
    real z[DIMENSION];
//? events
    double kept[MEMORY];
//?
    const int steps = steps_between(from, to);
    if (steps == 0) {
        return INTERVAL;
    }
    for (int i = 0; i < DIMENSION; i++) {
        z[i] = x[i];
    }
//? events
    for (int i = 0; i < MEMORY; i++) {
        kept[i] = m[i];
    }
//?
    if (!integrate(flow, from, to, steps, w, zMEMORY_ARGUMENT)) {
//? events
        const truth is_endless = m[ENDLESS] > 0.0 ? 1 : 0;
        for (int i = 0; i < MEMORY; i++) {
            m[i] = kept[i];
        }
        if (is_endless) {
            return EVENTS;
        }
//?
        return NOT_FINITE;
    }
    for (int i = 0; i < DIMENSION; i++) {
        x[i] = z[i];
    }
    return 0;
}
