/* A state is off by an error of its own, less what is expected of the others' errors. */
static void renew(real *root, int state, const real *expected, real own)
{
    real rows[(STATES + 1) * STATES];
    for (int k = 0; k < STATES; k++) {
        for (int i = 0; i < STATES; i++) {
            rows[k * STATES + i] = i == state ? -expected[k] : root[i * STATES + k];
        }
    }
    for (int i = 0; i < STATES; i++) {
        rows[STATES * STATES + i] = i == state ? own : R(0.0);
    }
    root_of_rows(rows, STATES + 1, root);
}

/* The measurement of a sensor is a new reading: it is off from what is expected by an error of its own, less the
   estimate's. c: how the sensors depend on x. */
static void reset(real *root, const real *c, int sensor, real reading)
{
    real expected[STATES];
    project(root, c, sensor, expected);
    renew(root, OWN + sensor, expected, sqrt(noise_variance(sensor, reading)));
}
