/* How many equal steps make the interval; 0 where it is too short to be told apart or takes more
   than a million. */
static int steps_between(double from, double to)
{
    const double length = to - from;
    const double resolution = 1.4210854715202004e-14 * (to < 0.0 ? -to : to);
    if (!(length > resolution) || !(length > 1e-307) || !(length < 1e300)) {
        return 0;
    }
    const double count = ceil(length / STEP_LENGTH * (1.0 - 1e-12));
    if (!(count <= 1e6)) {
        return 0;
    }
    return count < 1.0 ? 1 : (int)count;
}
