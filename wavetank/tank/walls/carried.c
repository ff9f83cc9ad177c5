/* Places that a paddle carries, and back; for wavetank/tank/walls/carried.py. */
#include <stdint.h>

typedef void (*Inverse)(long count, const double *r, const double *moved, double *found);

static double share(double r)
{
    return r < 0.0 ? 1.0 - r : (1.0 - r) * (1.0 - r) * (1.0 + r);
}

/* Of a paddle with a reach, a point where it stands and its normal; places of each time are so many numbers further on. */
void carried(long times, long count, long further, const double *paddle, const double *places, const double *moved,
             double *found, uintptr_t take_back)
{
    const double reach = paddle[0], *point = paddle + 1, *normal = paddle + 3;
    for (long k = 0; k < times; ++k, places += further)
        for (long n = 0; n < count; ++n, ++moved, found += 2) {
            const double *place = places + 2 * n;
            const double distance = normal[0] * (place[0] - point[0]) + normal[1] * (place[1] - point[1]);
            double shift = 0.0;
            if (distance < reach && take_back) {
                const double r = distance / reach, away = *moved / reach;
                ((Inverse)take_back)(1, &r, &away, &shift);
                shift = reach * shift - distance;
            } else if (distance < reach)
                shift = share(distance / reach) * *moved;
            for (int axis = 0; axis < 2; ++axis)
                found[axis] = place[axis] + shift * normal[axis];
        }
}
