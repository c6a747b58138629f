/* Takes z along its field in equal steps of the classical Runge-Kutta method. 0 where a value is
   not finite: z is then of no use. */
static int integrate(field f, double from, double to, int steps, const real *w, real *z)
{
    real first[DIMENSION];
    real middle[DIMENSION];
    real last[DIMENSION];
    real stage[DIMENSION];
    double t = from;
    for (int step = 1; step <= steps; step++) {
        const double next = from + (to - from) * ((double)step / (double)steps);
        const double length = next - t;
        const real h = (real)length;
        f((real)t, z, w, first);
        for (int i = 0; i < DIMENSION; i++) {
            stage[i] = z[i] + h * R(0.5) * first[i];
        }
        f((real)(t + 0.5 * length), stage, w, middle);
        for (int i = 0; i < DIMENSION; i++) {
            stage[i] = z[i] + h * R(0.5) * middle[i];
        }
        f((real)(t + 0.5 * length), stage, w, last);
        for (int i = 0; i < DIMENSION; i++) {
            stage[i] = z[i] + h * last[i];
            middle[i] += last[i];
        }
        f((real)(t + length), stage, w, last);
        for (int i = 0; i < DIMENSION; i++) {
            z[i] += h / R(6.0) * (first[i] + R(2.0) * middle[i] + last[i]);
            if (!isfinite(z[i])) {
                return 0;
            }
        }
        t = next;
    }
    return 1;
}
