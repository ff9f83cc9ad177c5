/* Factors of a mass matrix along a slice or ring, of wavetank/fem/mass.py; cells.c and chain.c stand before. */

/* The first row that other weights than those ``kept``, which become these, change; how many there are if none does. */
static long first_changed(const Cells *cells, const double *weights, double *kept, const Chain *c)
{
    const size_t batch = sizeof(stored) * POINTS;
    long first = c->dofs - c->cut;
    EACH(b, cells->batches)
        if (memcmp((const char *)weights + b * batch, (const char *)kept + b * batch, batch)) {
            memcpy((char *)kept + b * batch, (const char *)weights + b * batch, batch);
            EACH(i, NODES * LANES) {
                const long row = c->cut ? 0 : c->row[cells->dofs[b * NODES * LANES + i]];
                first = row < first ? row : first;
            }
        }
    return first;
}

/* Whether one of some degrees of freedom has that row, or one behind. */
INLINE int reaches(const Chain *c, long first, const int *dofs, int count)
{
    int any = 0;
    EACH(i, count)
        any |= c->row[dofs[i]] >= first;
    return any;
}

/* Add the mass matrix from a row on. */
static void add_mass(const Cells *cells, const double *weights, long first, const Chain *c)
{
    EACH(b, cells->batches) {
        const int *dofs = cells->dofs + b * NODES * LANES;
        if (!reaches(c, first, dofs, NODES * LANES))
            continue;
        v A[NODES][NODES] = {{{0.0}}};
        EACH(q, POINTS) {
            const v weight = ((const stored *)weights)[(long)b * POINTS + q];
            EACH(i, NODES)
                EACH(j, NODES)
                    A[i][j] += cells->values[q * NODES + i] * cells->values[q * NODES + j] * weight;
        }
        EACH(i, NODES)
            EACH(j, NODES)
                EACH(l, LANES) {
                    const long row = c->row[dofs[i * LANES + l]], other = c->row[dofs[j * LANES + l]];
                    if (other <= row && row >= first)
                        *entry(c, row, other) += A[i][j][l];
                }
    }
}

/* The factors of other weights than those ``kept``; rows before the first that they change stay. */
INLINE void factor_mass(const Cells *cells, const double *weights, double *kept, const Chain *c)
{
    const long first = first_changed(cells, weights, kept, c);
    if (first == c->dofs - c->cut)
        return;
    clear_chain(c, first);
    add_mass(cells, weights, first, c);
    factorise(c, first);
}

/* x <- the inverse of b, both [degree of freedom]; x may be b. */
static void solve_mass(const Chain *c, const double *b, double *x, double *work)
{
    EACH(i, c->dofs)
        work[c->row[i]] = b[i];
    solve_chain(c, work, work);
    EACH(i, c->dofs)
        x[i] = work[c->row[i]];
}

/* The same of two at once, x of b and y of d, bit for bit: in a slice what one waits for leaves time for the other. */
static void solve_both(const Chain *c, const double *b, const double *d, double *x, double *y, double *work)
{
    if (c->cut) {
        solve_mass(c, b, x, work);
        solve_mass(c, d, y, work);
        return;
    }
    EACH(i, c->dofs)
        work[2 * c->row[i]] = b[i], work[2 * c->row[i] + 1] = d[i];
    forth_and_back(2, c->dofs, c->L, work, work);
    EACH(i, c->dofs)
        x[i] = work[2 * c->row[i]], y[i] = work[2 * c->row[i] + 1];
}
