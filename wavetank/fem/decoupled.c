/* The decoupled modes of layers along a slice or ring, of wavetank/fem/along.py; layers.c and chain.c stand before.

ORDERED         whether degrees of freedom are numbered as they follow each other */
#define ROW_OF(c, dof) (ORDERED ? (dof) : (c)->row[dof])

typedef struct {
    const Layers *layers;
    v along[POINTS], up[POINTS];    /* second derivatives by u and by w, averaged over the depth */
} Averages;

INLINE void average_at(const void *what, const Cells *c, long b, int q, const v *u, v *r)
{
    Averages *averages = (Averages *)what;
    v f[OF_FIELDS], k[HESSIANS];
    in_space(c, b, q, FIELDS, u, FIELDS, f);
    averages->along[q] = averages->up[q] = zero;
    EACH(z, LEVELS) {
        second(c, averages->layers, b, q, z, f, k);
        averages->along[q] += k[0], averages->up[q] += k[HESSIANS - 1];
    }
}

/* Take over the modes of layers that are averaged over the depth, of the fields, [dof][field]; lambda[group][mode]. */
static void decouple(const Cells *cells, const Layers *layers, const REAL *fields, const REAL *lambda, const Chain *c)
{
    Averages averages = {layers};
    clear_chain(c, 0);
    EACH(b, cells->batches) {
        v X[NODES * FIELDS], A[NODES][NODES] = {{{0.0}}}, B[NODES][NODES] = {{{0.0}}};
        gather(cells, b, FIELDS, fields, FIELDS, X);
        through(cells, b, DIM, FIELDS, X, 0, X, average_at, &averages);
        EACH(q, POINTS)
            EACH(i, NODES)
                EACH(j, NODES) {
                    A[i][j] += cells->slopes[q * NODES + i] * cells->slopes[q * NODES + j] * averages.along[q];
                    B[i][j] += cells->values[q * NODES + i] * cells->values[q * NODES + j] * averages.up[q];
                }
        EACH(i, NODES)
            EACH(j, NODES)
                EACH(l, LANES) {
                    const long row = ROW_OF(c, cells->dofs[(b * NODES + i) * LANES + l]);
                    const long other = ROW_OF(c, cells->dofs[(b * NODES + j) * LANES + l]);
                    if (other > row)
                        continue;
                    EACH(g, GROUPS)
                        entry(c, row, other)[g] += A[i][j][l] + ((const abreast *)lambda)[g] * B[i][j][l];
                }
    }
    factorise(c, 0);
}

/* x <- the sum over modes j of s_j times the inverse of mode j of s_j r, all [degree of freedom]; s[group][mode]. */
static void respond(const Chain *c, const REAL *s, const double *r, double *x, REAL *work)
{
    abreast *rows = (abreast *)work;
    const abreast *shares = (const abreast *)s;
    EACH(i, c->dofs)
        EACH(g, GROUPS)
            rows[(long)c->row[i] * GROUPS + g] = shares[g] * (REAL)r[i];
    solve_chain(c, rows, rows);
    EACH(i, c->dofs) {
        abreast parts = {0.0};
        EACH(g, GROUPS)
            parts += shares[g] * rows[(long)c->row[i] * GROUPS + g];
        x[i] = 0.0;
        EACH(j, ABREAST)
            x[i] += parts[j];
    }
}
