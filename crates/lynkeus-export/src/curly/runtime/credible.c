/* Where a sensor's block of readings is full the next one begins, twice as long up to a length. The one before
   is kept: both are about the latest half of the readings so far, then the latest ones. */
static void turn(STATE *s, int i)
{
    const int before = SENSORS + i;
//? gate
    const int count = s->taken[i] + s->kept_out[i];
//?
//? !gate
    const int count = s->taken[i];
//?
    if (count >= s->block[i]) {
        s->taken[before] = s->taken[i];
        s->squares[before] = s->squares[i];
        s->largest[before] = s->largest[i];
        s->taken[i] = 0;
        s->squares[i] = R(0.0);
        s->largest[i] = R(0.0);
//? gate
        s->kept_out[before] = s->kept_out[i];
        s->kept_out[i] = 0;
//?
        if (s->block[i] < LONGEST_BLOCK) {
            s->block[i] += s->block[i];
        }
    }
}

/* Counts a reading that is taken, by the square of how many deviations it is off from what was expected. */
static void compare(STATE *s, int i, real square_of_off)
{
    const real counted = square_of_off < MOST_OFF ? square_of_off : MOST_OFF;
    turn(s, i);
    s->taken[i]++;
    s->squares[i] += counted;
    if (counted > s->largest[i]) {
        s->largest[i] = counted;
    }
}

/* Whether the latest readings of a sensor contradict the estimate: their squares, but for the largest of several,
   have a mean that noise and model do not explain, and not by chance. */
static truth contradicts(const STATE *s, int i)
{
    const int before = SENSORS + i;
    int count = s->taken[i] + s->taken[before];
    real squares = s->squares[i] + s->squares[before];
//? gate
    const int rejected = s->kept_out[i] + s->kept_out[before];
    if (rejected > count && rejected + count >= ENOUGH) {
        return 1;
    }
//?
    if (count >= FEW) {
        const real largest = s->largest[i] > s->largest[before] ? s->largest[i] : s->largest[before];
        squares -= largest;
        count--;
    }
    const real n = (real)count;
//? chance
    /* more than this is the sum of n squares of normal numbers once in a million cases */
    if (squares <= R(2.0) * n + CHANCE) {
        return 0;
    }
//?
    return squares > ALLOWED * n ? 1 : 0;
}

/* Whether nothing speaks against the estimate: there is one, the last sample had one, and no sensor contradicts it. */
static truth is_credible(const STATE *s)
{
    if (!s->started || s->refused > 0) {
        return 0;
    }
    for (int i = 0; i < SENSORS; i++) {
        if (contradicts(s, i)) {
            return 0;
        }
    }
    return 1;
}
