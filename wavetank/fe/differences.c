/* The largest differences of rows that follow each other, of wavetank/fe/differences.py. */
typedef double v __attribute__((vector_size(32)));
typedef double stored __attribute__((vector_size(32), aligned(8)));
typedef long long mask __attribute__((vector_size(32)));

#define FOURS 4
#define EACH _Pragma("GCC unroll 4") for (int g = 0; g < FOURS; ++g)

/* The largest magnitude of sum_i weights[i] row_i at columns; what is not a number is larger than all. Of one row at a
time, so that it is the same whichever others are asked for. */
static __attribute__((noinline)) double of_row(long columns, int terms, const double *weights, const double *rows)
{
    double most = 0.0;
    if (columns < 4 * FOURS) {
        for (long j = 0; j < columns; ++j) {
            double one = 0.0;
            for (int i = 0; i < terms; ++i)
                one += weights[i] * rows[i * columns + j];
            one = one < 0.0 ? -one : one;
            if (one > most || one != one)
                most = one;
            if (most != most)
                return most;
        }
        return most;
    }
    v high = {0.0};
    mask unknown = {0};
    for (long begin = 0; begin < columns; begin += 4 * FOURS) {
        const double *at = rows + (begin + 4 * FOURS <= columns ? begin : columns - 4 * FOURS); /* some twice */
        v sum[FOURS] = {{0.0}};
        for (int i = 0; i < terms; ++i, at += columns)
            EACH sum[g] += weights[i] * ((const stored *)at)[g];
        EACH {
            const v size = (v)((mask)sum[g] & 0x7fffffffffffffffLL);
            const mask more = size > high;
            high = (v)((more & (mask)size) | (~more & (mask)high));
            unknown |= size != size;
        }
    }
    for (int i = 0; i < 4; ++i) {
        if (unknown[i])
            return 0.0 / 0.0;
        most = high[i] > most ? high[i] : most;
    }
    return most;
}

void largest_differences(long rows, long columns, int terms, const double *weights, const double *given, double *found)
{
    for (long k = 0; k <= rows - terms; ++k)
        found[k] = of_row(columns, terms, weights, given + k * columns);
}
