/* Factors of a mass matrix along a slice or ring, of wavetank/fe/mass.py; mass.c and chain.c stand before. */

static void factor_mass(const Cells *cells, const double *weights, const Chain *c)
{
    clear_chain(c);
    EACH(b, cells->batches) {
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
                    const long row = c->row[cells->dofs[(b * NODES + i) * LANES + l]];
                    const long other = c->row[cells->dofs[(b * NODES + j) * LANES + l]];
                    if (other <= row)
                        *entry(c, row, other) += A[i][j][l];
                }
    }
    factorise(c);
}

/* x <- the inverse of b, both [degree of freedom]. */
static void solve_mass(const Chain *c, const double *b, double *x, double *work)
{
    EACH(i, c->dofs)
        work[c->row[i]] = b[i];
    solve_chain(c, work, work);
    EACH(i, c->dofs)
        x[i] = work[c->row[i]];
}
