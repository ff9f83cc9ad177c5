/* W of a paddle that leans along a slice, and its derivatives, of leaning.py.

NODES, POINTS   of a cell
LEVELS          of the rule over the column at the paddle
NUMBERS         of a degree of freedom; the last one is the potential at the surface
DEGREE          of the shape's polynomial */
#define EACH(i, most) for (int i = 0; i < (most); ++i)

static double horner(const double *c, int degree, double x)
{
    double sum = c[degree];
    for (int k = degree - 1; k >= 0; --k)
        sum = c[k] + x * sum;
    return sum;
}

/* f at a height, and its slope there. */
static double share(const Leaning *w, double z)
{
    return horner(w->shape, DEGREE, -z / w->unit);
}

static double slope(const Leaning *w, double z)
{
    return horner(w->slope, DEGREE - 1, -z / w->unit) / w->unit;
}

/* int f dz over a column. */
static double over(const Leaning *w, double h)
{
    const double d = w->depth;
    return (h - d) * horner(w->integral, DEGREE, (d - h) / w->unit) + d * horner(w->integral, DEGREE, d / w->unit);
}

/* The column and the slope of the potential at a point of a cell. */
static double at(const Leaning *w, int cell, int q, const double *column, const double *phi, double *along)
{
    double h = 0.0, sum = 0.0;
    EACH(i, NODES) {
        const long dof = w->dofs[cell * NODES + i];
        h += w->values[q * NODES + i] * column[dof];
        sum += w->slopes[q * NODES + i] * (phi ? phi[dof * NUMBERS + NUMBERS - 1] : 0.0);
    }
    *along = sum;
    return h;
}

/* y = factor dW/dphi at 1 m/s where it is not nothing, [degree of freedom][number]. */
static void by_potential(const Leaning *w, double factor, const double *column, double *y)
{
    double none;
    EACH(i, w->cells * NODES)
        y[(long)w->dofs[i] * NUMBERS + NUMBERS - 1] = 0.0;
    EACH(c, w->cells)
        EACH(q, POINTS) {
            const double part = factor * w->carried[c * POINTS + q] * over(w, at(w, c, q, column, 0, &none));
            EACH(i, NODES)
                y[(long)w->dofs[c * NODES + i] * NUMBERS + NUMBERS - 1] += part * w->slopes[q * NODES + i];
        }
    double *here = y + (long)w->node * NUMBERS;
    const double h = column[w->node];
    EACH(j, NUMBERS - 1)
        here[j] = 0.0;
    EACH(l, LEVELS) {
        const double f = factor * h * share(w, w->zeta[l] * h - w->depth);
        EACH(j, NUMBERS - 1)
            here[j] += f * w->rows[l * (NUMBERS - 1) + j];
    }
}

/* y = factor dW/dh at 1 m/s where it is not nothing, [degree of freedom]. */
static void by_column(const Leaning *w, double factor, const double *column, const double *phi, double *y)
{
    EACH(i, w->cells * NODES)
        y[w->dofs[i]] = 0.0;
    EACH(c, w->cells)
        EACH(q, POINTS) {
            double along;
            const double h = at(w, c, q, column, phi, &along);
            const double part = factor * w->carried[c * POINTS + q] * share(w, h - w->depth) * along;
            EACH(i, NODES)
                y[w->dofs[c * NODES + i]] += part * w->values[q * NODES + i];
        }
    const double h = column[w->node], *here = phi + (long)w->node * NUMBERS;
    EACH(l, LEVELS) {
        const double z = w->zeta[l] * h - w->depth, f = share(w, z) + h * w->zeta[l] * slope(w, z);
        EACH(j, NUMBERS - 1)
            y[w->node] += factor * f * w->rows[l * (NUMBERS - 1) + j] * here[j];
    }
}
