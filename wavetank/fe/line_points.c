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

/* Of fields [field][dof], the first at the first ``each`` of the places, and so on. */
void values_along(const Line *l, long places, long each, const double *x, const double *fields, double *found)
{
    for (long i = 0; i < places; ++i) {
        const int cell = cell_at(l, x[i]), *dofs = l->dofs + cell * FUNCTIONS;
        const double *field = fields + i / each * l->rows;
        double part = (x[i] - l->start[cell]) / l->along[cell], P[FUNCTIONS + 1] = {1.0}, sum = 0.0;
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
        found[i] = sum;
    }
}
