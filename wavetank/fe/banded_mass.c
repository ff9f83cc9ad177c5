/* Factors of a mass matrix along a slice or ring, of wavetank/fe/mass.py; mass.c and chain.c stand before. */

/* The factors of other weights than those ``kept``, which become these; rows before the first that they change stay. */
static void factor_mass(const Cells *cells, const double *weights, double *kept, const Chain *c)
{
    const size_t batch = sizeof(stored) * POINTS;
    const long rows = c->dofs - c->cut;
    long first = rows;
    EACH(b, cells->batches)
        if (memcmp((const char *)weights + b * batch, (const char *)kept + b * batch, batch))
            EACH(i, NODES * LANES) {
                const long row = c->cut ? 0 : c->row[cells->dofs[b * NODES * LANES + i]];
                first = row < first ? row : first;
            }
    if (first == rows)
        return;
    memcpy(kept, weights, batch * cells->batches);
    clear_chain(c, first);
    EACH(b, cells->batches) {
        v A[NODES][NODES] = {{{0.0}}};
        long last = 0;
        EACH(i, NODES * LANES) {
            const long row = c->row[cells->dofs[b * NODES * LANES + i]];
            last = row > last ? row : last;
        }
        if (last < first)
            continue;
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
                    if (other <= row && row >= first)
                        *entry(c, row, other) += A[i][j][l];
                }
    }
    factorise(c, first);
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
