/* The held measurement of a sensor is a new reading, with an error of its own. */
static void reset(real *root, int sensor, real reading)
{
    real rows[(STATES + 1) * STATES];
    const int state = OWN + sensor;
    for (int k = 0; k < STATES; k++) {
        for (int i = 0; i < STATES; i++) {
            rows[k * STATES + i] = i == state ? R(0.0) : root[i * STATES + k];
        }
    }
    for (int i = 0; i < STATES; i++) {
        rows[STATES * STATES + i] = i == state ? sqrt(noise_variance(sensor, reading)) : R(0.0);
    }
    root_of_rows(rows, STATES + 1, root);
}
