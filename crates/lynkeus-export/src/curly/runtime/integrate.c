/* Takes z along its field in equal steps of the classical Runge-Kutta method. 0 where a value is
   not finite: z is then of no use. */
static truth integrate(field f, double from, double to, int steps, const real *w, real *z)
{
    real first[DIMENSION];
    real middle[DIMENSION];
    real last[DIMENSION];
    real stage[DIMENSION];
//? single
    /* the field takes time as float; where double is slow, it is kept out of the loop */
    const real t_start = (real)from;
    const double span = to - from;
    const real h = (real)span / (real)steps;
    for (int step = 0; step < steps; step++) {
        const real t_first = t_start + h * (real)step;
        const real t_middle = t_first + h * R(0.5);
        const real t_last = t_first + h;
//?
//? !single
    double t = from;
    for (int step = 1; step <= steps; step++) {
        const double next = from + (to - from) * ((double)step / (double)steps);
        const double length = next - t;
        const real h = (real)length;
        const real t_first = (real)t;
        const real t_middle = (real)(t + 0.5 * length);
        const real t_last = (real)(t + length);
//?
        f(t_first, z, w, first);
        for (int i = 0; i < DIMENSION; i++) {
            stage[i] = z[i] + h * R(0.5) * first[i];
        }
        f(t_middle, stage, w, middle);
        for (int i = 0; i < DIMENSION; i++) {
            stage[i] = z[i] + h * R(0.5) * middle[i];
        }
        f(t_middle, stage, w, last);
        for (int i = 0; i < DIMENSION; i++) {
            stage[i] = z[i] + h * last[i];
            middle[i] += last[i];
        }
        f(t_last, stage, w, last);
        for (int i = 0; i < DIMENSION; i++) {
            z[i] += h / R(6.0) * (first[i] + R(2.0) * middle[i] + last[i]);
            if (!isfinite(z[i])) {
                return 0;
            }
        }
//? !single
        t = next;
//?
    }
    return 1;
}
