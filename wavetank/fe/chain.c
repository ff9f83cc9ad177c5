/* Symmetric banded systems along a slice or ring, ABREAST of them at once; cells.c stands before.

BAND            how far apart coupled rows can be
ABREAST         systems of a group

Rows stand in the order in which degrees of freedom follow each other: [group][row][distance to the column before]. A
ring is cut: one of its rows borders the rest, and is last. */
#include <math.h>
#include <string.h>

#if ABREAST == 1
typedef REAL abreast;
#else
typedef REAL abreast __attribute__((vector_size(sizeof(REAL) * ABREAST), aligned(sizeof(REAL))));
#endif

typedef struct {
    int dofs, cut, groups;  /* cut: 1 of a ring, else 0 */
    const int *row;         /* [degree of freedom] */
    REAL *L;                /* the matrices, then their factors L D L', the reciprocals of D on the diagonal */
    REAL *column;           /* [group][row] of the border */
    REAL *reduced;          /* the rest's inverse times it */
    REAL *corner;           /* [group] of the border; then the reciprocal of what the rest leaves of it */
} Chain;

INLINE abreast *matrix_of(const Chain *c, int group)
{
    return (abreast *)c->L + (long)group * (c->dofs - c->cut + BAND) * (BAND + 1);
}

INLINE abreast *border_of(const Chain *c, int group, REAL *of)
{
    return (abreast *)of + (long)group * (c->dofs - c->cut);
}

/* Where the entry of two rows is, the second not behind the first; NULL of the others. */
INLINE abreast *entry(const Chain *c, int group, long row, long other)
{
    const long rows = c->dofs - c->cut;
    if (other > row)
        return NULL;
    return row < rows     ? matrix_of(c, group) + row * (BAND + 1) + row - other
           : other < rows ? border_of(c, group, c->column) + other
                          : (abreast *)c->corner + group;
}

static void clear_chain(const Chain *c)
{
    const long rows = c->dofs - c->cut;
    memset(c->L, 0, sizeof(abreast) * c->groups * (rows + BAND) * (BAND + 1));
    memset(c->column, 0, sizeof(abreast) * c->groups * c->cut * rows);
    memset(c->corner, 0, sizeof(abreast) * c->groups);
}

INLINE abreast reciprocal(abreast of)
{
    EACH(l, ABREAST) {
        REAL *one = (REAL *)&of + l;
        *one = *one > 0.0 ? 1.0 / *one : NAN;
    }
    return of;
}

static void factor(long rows, abreast *restrict A)
{
    for (long i = 0; i < rows; ++i) {
        abreast *row = A + i * (BAND + 1);
        abreast scaled[BAND + 1] = {0}, rest = row[0];  /* entries of L D */
        for (int d = i < BAND ? i : BAND; d > 0; --d) {
            const abreast *other = A + (i - d) * (BAND + 1);
            abreast sum = row[d];
            for (int e = d + 1; e <= BAND && e <= i; ++e)
                sum -= scaled[e] * other[e - d];
            scaled[d] = sum;
            row[d] = sum * other[0];
            rest -= sum * row[d];
        }
        row[0] = reciprocal(rest);
    }
}

/* x <- the inverse of the rest of b, both [row] with a stride. */
INLINE void forth_and_back(long rows, long stride, const abreast *restrict L, const abreast *b, abreast *x)
{
    abreast last[BAND];
    EACH(d, BAND)
        last[d] = (abreast){0.0};
    for (long i = 0; i < rows; ++i) {
        const abreast *row = L + i * (BAND + 1);
        abreast here = b[i * stride];
        for (int d = BAND; d > 0; --d)
            here -= row[d] * last[d - 1];
        for (int d = BAND - 1; d > 0; --d)
            last[d] = last[d - 1];
        last[0] = here;
        x[i * stride] = here * row[0];
    }
    EACH(d, BAND)
        last[d] = (abreast){0.0};
    for (long i = rows - 1; i >= 0; --i) {
        abreast here = x[i * stride];
        for (int d = BAND; d > 0; --d)
            here -= L[(i + d) * (BAND + 1) + d] * last[d - 1];  /* BAND rows of zeros follow the last one */
        for (int d = BAND - 1; d > 0; --d)
            last[d] = last[d - 1];
        last[0] = x[i * stride] = here;
    }
}

/* x <- the inverse of b, both [row] with a stride; x may be b. */
INLINE void solve_group(const Chain *c, int group, long stride, const abreast *b, abreast *x)
{
    const long rows = c->dofs - c->cut;
    const abreast border = c->cut ? b[rows * stride] : (abreast){0.0};
    forth_and_back(rows, stride, matrix_of(c, group), b, x);
    if (c->cut) {
        const abreast *column = border_of(c, group, c->column), *reduced = border_of(c, group, c->reduced);
        abreast last = border;
        for (long i = 0; i < rows; ++i)
            last -= column[i] * x[i * stride];
        last *= ((const abreast *)c->corner)[group];
        for (long i = 0; i < rows; ++i)
            x[i * stride] -= reduced[i] * last;
        x[rows * stride] = last;
    }
}

static void factorise(const Chain *c)
{
    const long rows = c->dofs - c->cut;
    EACH(group, c->groups) {
        const abreast *column = border_of(c, group, c->column);
        abreast *reduced = border_of(c, group, c->reduced), *corner = (abreast *)c->corner + group;
        factor(rows, matrix_of(c, group));
        if (!c->cut)
            continue;
        forth_and_back(rows, 1, matrix_of(c, group), column, reduced);
        for (long i = 0; i < rows; ++i)
            *corner -= column[i] * reduced[i];
        *corner = reciprocal(*corner);
    }
}
