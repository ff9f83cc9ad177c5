/* What is put in by each of some times, by Adams-Moulton's rule of order 4; for wavetank/simulation/supply.py. Of the first two
   steps of a length Simpson's rule, when both are there: the first by itself has its ends only. */
#include <math.h>
#include <string.h>

#define KNOWN 4
#define SAME 1e-6 /* of a step: so near are steps of one length */

static const double weights[][KNOWN] = {/* of the rates at the newest, second newest, ... time, by how many there are */
    {0.0}, {1.0 / 2, 1.0 / 2}, {5.0 / 12, 8.0 / 12, -1.0 / 12}, {9.0 / 24, 19.0 / 24, -5.0 / 24, 1.0 / 24}};

typedef struct {
    double done, t, dt, known, rates[KNOWN];
} Work;

void put_in(long count, const double *t, const double *rates, double *work, double *done)
{
    Work *w = (Work *)work;
    for (long k = 0; k < count; ++k) {
        const double dt = t[k] - w->t, last = w->dt;
        const int equal = fabs(dt - last) <= SAME * fmax(fabs(dt), fabs(last)); /* the rule is of such steps */
        w->known = fmin(w->known + 1.0, equal ? KNOWN : 2.0);
        memmove(w->rates + 1, w->rates, sizeof(double) * (KNOWN - 1));
        w->rates[0] = rates[k];
        double mean = w->known == 3.0 ? (w->rates[2] - 2.0 * w->rates[1] + w->rates[0]) * -1.0 / 12 : 0.0;
        for (int n = 0; n < w->known; ++n)
            mean += weights[(int)w->known - 1][n] * w->rates[n];
        done[k] = w->done += dt * mean;
        w->t = t[k], w->dt = dt;
    }
}
