/* z is x, then the rows of (Phi W): Phi' = F Phi and W' = F W + W F' + Q along x, F the Jacobian
   of the flow (Q and W in units of NOISE_SCALE). */
static void linearised(real t, const real *z, const real *w, real *dz)
{
    real slopes[ENTRIES_ROOM];
    linear_flow(t, z, w, dz, slopes);
    for (int i = STATES; i < DIMENSION; i++) {
        dz[i] = R(0.0);
    }
    for (int e = 0; e < ENTRIES; e++) {
        const int into = STATES + entry_rows[e] * WIDTH;
        const int from = STATES + entry_columns[e] * WIDTH;
        for (int k = 0; k < WIDTH; k++) {
            dz[into + k] += slopes[e] * z[from + k];
        }
    }
//? noisy
    for (int i = 0; i < STATES; i++) {
        for (int j = 0; j < i; j++) {
            const int below = STATES + i * WIDTH + STATES + j;
            const int above = STATES + j * WIDTH + STATES + i;
            const real sum = dz[below] + dz[above];
            dz[below] = sum;
            dz[above] = sum;
        }
        const int diagonal = STATES + i * WIDTH + STATES + i;
        dz[diagonal] = R(2.0) * dz[diagonal] + process_noise[i];
    }
//?
}
