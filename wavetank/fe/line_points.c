/* Values of fields at places along a slice, for wavetank/fe/line_points.py. */

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

static double value(const Line *l, double x, const double *field)
{
    const int cell = cell_at(l, x), *dofs = l->dofs + cell * FUNCTIONS;
    double part = (x - l->start[cell]) / l->along[cell], P[FUNCTIONS + 1] = {1.0}, sum = 0.0;
    part = part < 0.0 ? 0.0 : part > 1.0 ? 1.0 : part;
    const double s = P[1] = 2.0 * part - 1.0;
    for (int k = 1; k + 1 < FUNCTIONS; ++k)
        P[k + 1] = ((2 * k + 1) * s * P[k] - k * P[k - 1]) / (k + 1);
    for (int j = 0; j < FUNCTIONS; ++j) {
        double weight = 0.0;
        for (int k = 0; k < FUNCTIONS; ++k)
            weight += l->legendre[j * FUNCTIONS + k] * P[k];
        sum += weight * field[dofs[j]];
    }
    return sum;
}

/* Of fields [field][dof] at places of each, whose x are so many numbers further on from one field to the next. */
void values_along(const Line *l, long fields, long places, long further, const double *x, const double *field, double *found)
{
    for (; fields-- > 0; x += further, field += l->rows)
        for (long n = 0; n < places; ++n)
            *found++ = value(l, x[n], field);
}
