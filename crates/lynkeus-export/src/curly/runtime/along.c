/* x, then the rows of (Phi W), from one time to another along a flow. 0 where it has no value. */
static truth along(field f, double from, double to, int steps, const real *w, const real *x, real *zMEMORY_PARAMETER)
{
    for (int i = 0; i < DIMENSION; i++) {
        z[i] = R(0.0);
    }
    for (int i = 0; i < STATES; i++) {
        z[i] = x[i];
        z[STATES + i * WIDTH + i] = R(1.0);
    }
    return integrate(f, from, to, steps, w, zMEMORY_ARGUMENT);
}
//? noisy

/* The rows of L', W = L L', from z: what the process noise comes to on the way. */
static void rows_of_noise(const real *z, const real *w, real *rows)
{
    real noise[STATES * STATES];
    real lower[STATES * STATES];
    (void)w;
    for (int i = 0; i < STATES; i++) {
        for (int j = 0; j < STATES; j++) {
            noise[i * STATES + j] = NOISE_SCALE * z[STATES + PLACE_I * WIDTH + STATES + PLACE_J];
        }
    }
    factorise(noise, STATES, lower);
    for (int i = 0; i < STATES; i++) {
        for (int k = 0; k <= i; k++) {
            rows[k * STATES + PLACE_I] = lower[i * STATES + k];
        }
    }
}
//?
