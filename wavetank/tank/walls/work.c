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

/* y = factor dW/dphi of a column, at 1 m/s. */
static void by_potential(const Entries *M, double factor, const double *column, double *y)
{
    times(M, factor, column, y);
}

/* y = factor dW/dh of a potential, at 1 m/s, whatever the column. */
static void by_column(const Entries *transposed, double factor, const double *column, const double *phi, double *y)
{
    times(transposed, factor, phi, y);
}
