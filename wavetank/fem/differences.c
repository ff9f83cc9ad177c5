/* The largest differences of rows that follow each other, of wavetank/fem/differences.py. */
#include <limits.h>
#include <string.h>

/* The bits of the largest magnitude of sum_i weights[i] rows[i] at columns: they are in the order of numbers, and what is not
   a number is beyond all. */
static inline __attribute__((always_inline)) long long largest(long columns, int terms, const double *weights,
                                                               const double *const *rows)
{
    long long most = 0, size;
    for (long j = 0; j < columns; ++j) {
        double sum = 0.0;
        for (int i = 0; i < terms; ++i)
            sum += weights[i] * rows[i][j];
        memcpy(&size, &sum, sizeof size);
        size &= LLONG_MAX;
        most = size > most ? size : most;
    }
    return most;
}

/* One difference at a time, so that it is the same whichever others are asked for; columns are summed together where it is
   known how many terms there are. */
static __attribute__((noinline)) long long of_rows(long columns, int terms, const double *weights, const double *const *rows)
{
    switch (terms) {
    case 4: return largest(columns, 4, weights, rows);
    case 6: return largest(columns, 6, weights, rows);
    case 7: return largest(columns, 7, weights, rows);
    case 9: return largest(columns, 9, weights, rows);
    default: return largest(columns, terms, weights, rows);
    }
}

/* Of some rows before, and others. */
void largest_differences(long first, long others, long columns, int terms, const double *weights, const double *before,
                         const double *values, double *found)
{
    const double *rows[terms];
    for (long k = 0; k <= first + others - terms; ++k) {
        for (long i = 0; i < terms; ++i)
            rows[i] = k + i < first ? before + (k + i) * columns : values + (k + i - first) * columns;
        const long long most = of_rows(columns, terms, weights, rows);
        memcpy(found + k, &most, sizeof most);
    }
}
