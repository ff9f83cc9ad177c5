/* Places that a paddle has carried, taken back; for wavetank/tank/walls/carried.py. Lengths in reaches. */
#include <math.h>

#define LITTLE 0.1
#define SETTLED 1e-8    /* the square is round-off */

static double share(double r)
{
    return (1.0 - r) * (1.0 - r) * (1.0 + r);
}

static double between(double r, double lowest)
{
    r = r < lowest ? lowest : r;
    return r > 1.0 ? 1.0 : r;
}

/* R with R + s(R) moved = r, for moved < 3/4, by Newton's method, started where it converges from one side: at an end where
   the map is flattest inside, at r = 1/3, or at that place where it is steepest there. Where little is moved it converges
   from anywhere, and starts where what is moved is taken back once. */
static double taken_back(double r, double moved)
{
    const double third = 1.0 / 3.0, inside = between(r, moved);    /* places beyond both ends are found without */
    double R = inside - share(inside) * moved, change = 1.0;
    if (fabs(moved) >= LITTLE)
        R = moved <= 0.0 ? third : inside > third + share(third) * moved ? 1.0 : 0.0;
    for (int trial = 0; trial < 100 && fabs(change) >= SETTLED; ++trial) {
        const double left = 1.0 - R, stretched = left * moved;
        change = (R + left * stretched * (1.0 + R) - inside) / (1.0 - stretched * (1.0 + 3.0 * R));
        R = between(R - change, 0.0);
    }
    const double before = (r - moved) / (1.0 - moved);
    return r >= 1.0 ? r : before < 0.0 ? before : R;
}

void take_back(long count, const double *r, const double *moved, double *found)
{
    for (long i = 0; i < count; ++i)
        found[i] = taken_back(r[i], moved[i]);
}
