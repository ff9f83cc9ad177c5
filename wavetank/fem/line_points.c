/* Values of fields at places along a slice, for wavetank/fem/line_points.py. */

typedef struct {
    int cells, rows;        /* cells in the order of x; degrees of freedom of a field */
    const double *edges;    /* where cells begin, and the last ends */
    const double *start, *along;
    const int *dofs;        /* [cell][function] */
    const double *legendre; /* of the functions of a cell, by Legendre's polynomials: [function][degree] */
} Line;

/* The last cell that begins before a place, or there. */
static int cell_at(const Line *l, double x)
{
    int cell = 0, behind = l->cells;
    while (cell + 1 < behind) {
        const int middle = (cell + behind) / 2;
        if (l->edges[middle] <= x)
            cell = middle;
        else
            behind = middle;
    }
    return cell;
}

/* The functions of the cell of a place, there; returns its degrees of freedom. */
static __attribute__((noinline)) const int *functions_at(const Line *l, double x, double *weights)
{
    const int cell = cell_at(l, x);
    double part = (x - l->start[cell]) / l->along[cell], P[FUNCTIONS + 1] = {1.0};
    part = part < 0.0 ? 0.0 : part > 1.0 ? 1.0 : part;
    const double s = P[1] = 2.0 * part - 1.0;
    for (int k = 1; k + 1 < FUNCTIONS; ++k)
        P[k + 1] = ((2 * k + 1) * s * P[k] - k * P[k - 1]) / (k + 1);
    for (int j = 0; j < FUNCTIONS; ++j) {
        weights[j] = 0.0;
        for (int k = 0; k < FUNCTIONS; ++k)
            weights[j] += l->legendre[j * FUNCTIONS + k] * P[k];
    }
    return l->dofs + cell * FUNCTIONS;
}

/* One by one, so that a value is the same whichever others are asked for. */
static __attribute__((noinline)) double value(const double *weights, const int *dofs, const double *field)
{
    double sum = 0.0;
    for (int j = 0; j < FUNCTIONS; ++j)
        sum += weights[j] * field[dofs[j]];
    return sum;
}

/* Of fields [field][dof] at places, the same of all or so many for each, whose x follow. */
void values_along(const Line *l, long fields, long places, int same, const double *x, const double *field, double *found)
{
    for (long n = 0; n < places; ++n) {
        const int *dofs;
        double weights[FUNCTIONS];
        for (long k = 0; k < fields; ++k) {
            if (k == 0 || !same)
                dofs = functions_at(l, x[same ? n : k * places + n], weights);
            found[k * places + n] = value(weights, dofs, field + k * l->rows);
        }
    }
}
