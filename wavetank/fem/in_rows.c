/* Fields at some times in rows, each a time, places and the fields in their order; for wavetank/fem/in_rows.py. */
#include <string.h>

void in_rows(long times, long n, const double *t, const double *x, const int *which, const int *order,
             const double *fields, const double *others, double *rows)
{
    for (long k = 0; k < times; ++k, rows += 1 + 3 * n) {
        const double *first = fields + which[k] * n, *second = others + which[k] * n;
        rows[0] = t[k];
        memcpy(rows + 1, x, sizeof(double) * n);
        for (long i = 0; i < n; ++i)
            rows[1 + n + i] = first[order[i]], rows[1 + 2 * n + i] = second[order[i]];
    }
}
