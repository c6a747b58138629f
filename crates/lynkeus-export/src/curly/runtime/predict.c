/* x and the root of P to another time: P = Phi P Phi' + W. 0, and nothing changed, where the flow
   has no value. */
static truth predict(field f, double from, double to, int steps, const real *w, real *x, real *rootMEMORY_PARAMETER)
{
    real z[DIMENSION];
    real rows[CARRIED * STATES];
    if (!along(f, from, to, steps, w, x, zMEMORY_ARGUMENT)) {
        return 0;
    }
    for (int i = 0; i < CARRIED * STATES; i++) {
        rows[i] = R(0.0);
    }
//? noisy
    rows_of_noise(z, w, rows);
//?
    for (int i = 0; i < STATES; i++) {
        for (int j = 0; j < STATES; j++) {
            const real phi = z[STATES + i * WIDTH + j];
            for (int k = 0; k <= j; k++) {
                rows[(CARRIED - STATES + k) * STATES + i] += phi * root[j * STATES + k];
            }
        }
    }
    root_of_rows(rows, CARRIED, root);
    for (int i = 0; i < STATES; i++) {
        x[i] = z[i];
    }
    return 1;
}
