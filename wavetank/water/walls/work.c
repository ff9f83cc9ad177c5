/* Products with a matrix of few entries in a row, of work.py. */

/* y = factor M x in the rows that have entries. */
static void times(const Entries *M, double factor, const double *x, double *y)
{
    for (int i = 0; i < M->rows; ++i) {
        double sum = 0.0;
        for (int j = 0; j < M->width; ++j)
            sum += M->entries[i * M->width + j] * x[M->places[i * M->width + j]];
        y[M->at[i]] = factor * sum;
    }
}

/* Return y M x. */
static double between(const Entries *M, const double *y, const double *x)
{
    double whole = 0.0;
    for (int i = 0; i < M->rows; ++i) {
        double sum = 0.0;
        for (int j = 0; j < M->width; ++j)
            sum += M->entries[i * M->width + j] * x[M->places[i * M->width + j]];
        whole += y[M->at[i]] * sum;
    }
    return whole;
}
