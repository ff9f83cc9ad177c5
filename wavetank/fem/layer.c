/* The energy of a horizontal layer at a point; cells.c stands before.

NUMBERS         of a degree of freedom: vertical functions, the last one's the surface potential
LEVELS          heights of layers
FIELDS          that the density depends on
OF_FIELDS       of them at a point: values, slopes in space
HESSIANS        second derivatives by (u_0 ..., w) in the cell's own coordinates: DIM (DIM + 1) / 2 + DIM + 1 */
#define OF_FIELDS ((1 + GDIM) * FIELDS)

typedef struct {
    const REAL *zeta;       /* [level] */
    const REAL *weights;    /* [level] */
    const REAL *P, *dP;     /* [level][number] */
    const REAL *constants;  /* that the density depends on */
} Layers;

/* The energy's second derivatives at a level, times all weights: k[uu ..., uw ..., ww]. */
INLINE void second(const Cells *c, const Layers *layers, long b, int q, int z, const v *f, v *k)
{
    const stored *inverse = inverse_at(c, b, q);
    const v weight = measure_at(c, b, q) * layers->weights[z];
    const REAL *constants = layers->constants, zeta = layers->zeta[z];
    v uu[GDIM][GDIM], uw[GDIM], ww;
    HESSIAN
    EACH(a, DIM)
        EACH(d, a + 1) {
            v sum = zero;
            EACH(i, GDIM)
                EACH(j, GDIM)
                    sum += inverse[i * DIM + a] * uu[i][j] * inverse[j * DIM + d];
            *k++ = weight * sum;
        }
    EACH(a, DIM) {
        v sum = zero;
        EACH(i, GDIM)
            sum += inverse[i * DIM + a] * uw[i];
        *k++ = weight * sum;
    }
    *k = weight * ww;
}
