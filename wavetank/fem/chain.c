/* Symmetric banded systems along a slice or ring, ABREAST of them at once; cells.c stands before.

BAND            how far apart coupled rows can be
ABREAST         systems in a vector
GROUPS          such vectors: systems are treated all at once, so that none waits for another

Rows stand in the order in which degrees of freedom follow each other: [row][distance to the column before][group][system]. A
ring is cut: one of its rows borders the rest, and is last. */
#include <math.h>
#include <string.h>

/* What is to be found before what it stands beside: a row waits for its neighbour with one product alone. That of one system
   alone takes all its neighbours in turn, the furthest first, which is what it waits for least. */
#ifdef __has_builtin
#if __has_builtin(__builtin_assoc_barrier)
#define FIRST __builtin_assoc_barrier
#endif
#endif
#ifndef FIRST
#define FIRST
#endif

#define IN_TURN (ABREAST == 1)
#if ABREAST == 1
typedef REAL abreast;
typedef REAL beside __attribute__((vector_size(2 * sizeof(REAL)), aligned(sizeof(REAL))));  /* two right-hand sides */
#else
typedef REAL abreast __attribute__((vector_size(sizeof(REAL) * ABREAST), aligned(sizeof(REAL))));
typedef abreast beside;
#endif

typedef struct {
    int dofs, cut;          /* cut: 1 of a ring, else 0 */
    const int *row;         /* [degree of freedom] */
    REAL *L;                /* the matrices, then their factors L D L', the reciprocals of D on the diagonal */
    REAL *column;           /* [row] of the border */
    REAL *reduced;          /* the rest's inverse times it */
    REAL *corner;           /* of the border; then the reciprocal of what the rest leaves of it */
} Chain;

/* Where the entries of two rows are, [group], the second not behind the first. */
INLINE abreast *entry(const Chain *c, long row, long other)
{
    const long rows = c->dofs - c->cut;
    return row < rows     ? (abreast *)c->L + (row * (BAND + 1) + row - other) * GROUPS
           : other < rows ? (abreast *)c->column + other * GROUPS
                          : (abreast *)c->corner;
}

/* From a row on. */
static void clear_chain(const Chain *c, long first)
{
    const long rows = c->dofs - c->cut;
    memset((abreast *)c->L + first * (BAND + 1) * GROUPS, 0, sizeof(abreast) * (rows + BAND - first) * (BAND + 1) * GROUPS);
    memset(c->column, 0, sizeof(abreast) * c->cut * rows * GROUPS);
    memset(c->corner, 0, sizeof(abreast) * GROUPS);
}

INLINE abreast reciprocal(abreast of)
{
    EACH(l, ABREAST) {
        REAL *one = (REAL *)&of + l;
        *one = *one > 0.0 ? 1.0 / *one : NAN;
    }
    return of;
}

/* A <- its factors, of a group; the rows before the first have theirs. */
static void factor(long first, long rows, abreast *restrict A)
{
    for (long i = first; i < rows; ++i) {
        abreast *row = A + i * (BAND + 1) * GROUPS;
        abreast scaled[BAND + 1] = {0}, rest = row[0];  /* entries of L D */
        for (int d = i < BAND ? i : BAND; d > 0; --d) {
            const abreast *other = A + (i - d) * (BAND + 1) * GROUPS;
            abreast sum = row[d * GROUPS];
            for (int e = d + 1; e <= BAND && e <= i; ++e)
                sum -= scaled[e] * other[(e - d) * GROUPS];
            scaled[d] = sum;
            row[d * GROUPS] = sum * other[0];
            rest -= sum * row[d * GROUPS];
        }
        row[0] = reciprocal(rest);
    }
}

/* Numbers of a row and group are read and written, of one right-hand side or two; one stands in a vector all the same: what is
   found of it is the same beside another, and a vector is copied in no time, where a number is not. */
INLINE beside side_at(int sides, const abreast *b, long at)
{
    return sides > 1 ? ((const beside *)b)[at] : (beside){0.0} + b[at];
}

INLINE void put_side(int sides, abreast *x, long at, beside what)
{
    if (sides > 1)
        ((beside *)x)[at] = what;
    else
        x[at] = *(const abreast *)&what;
}

/* x <- the inverse of the rest of b, both [row][group][side]. */
INLINE void forth_and_back(int sides, long rows, const abreast *restrict L, const abreast *b, abreast *x)
{
    beside last[BAND][GROUPS] = {0};
    for (long i = 0; i < rows; ++i) {
        const abreast *row = L + i * (BAND + 1) * GROUPS;
        EACH(g, GROUPS) {
            beside here = side_at(sides, b, i * GROUPS + g);
            for (int d = BAND; d > 0; --d)
                here = (IN_TURN || d == 1 ? FIRST(here) : here) - row[d * GROUPS + g] * last[d - 1][g];
            for (int d = BAND - 1; d > 0; --d)
                last[d][g] = last[d - 1][g];
            last[0][g] = here;
            put_side(sides, x, i * GROUPS + g, here * row[g]);
        }
    }
    EACH(d, BAND)
        EACH(g, GROUPS)
            last[d][g] = (beside){0.0};
    for (long i = rows - 1; i >= 0; --i)
        EACH(g, GROUPS) {
            beside here = side_at(sides, x, i * GROUPS + g);
            for (int d = BAND; d > 0; --d)  /* BAND rows of zeros follow the last one */
                here = (IN_TURN || d == 1 ? FIRST(here) : here) - L[((i + d) * (BAND + 1) + d) * GROUPS + g] * last[d - 1][g];
            for (int d = BAND - 1; d > 0; --d)
                last[d][g] = last[d - 1][g];
            last[0][g] = here;
            put_side(sides, x, i * GROUPS + g, here);
        }
}

/* x <- the inverse of b, both [row][group]; x may be b. */
INLINE void solve_chain(const Chain *c, const abreast *b, abreast *x)
{
    const long rows = c->dofs - c->cut;
    abreast border[GROUPS];
    EACH(g, GROUPS)
        border[g] = c->cut ? b[rows * GROUPS + g] : (abreast){0.0};
    forth_and_back(1, rows, (const abreast *)c->L, b, x);
    if (c->cut)
        EACH(g, GROUPS) {
            const abreast *column = (const abreast *)c->column + g, *reduced = (const abreast *)c->reduced + g;
            abreast last = border[g];
            for (long i = 0; i < rows; ++i)
                last -= column[i * GROUPS] * x[i * GROUPS + g];
            last *= ((const abreast *)c->corner)[g];
            for (long i = 0; i < rows; ++i)
                x[i * GROUPS + g] -= reduced[i * GROUPS] * last;
            x[rows * GROUPS + g] = last;
        }
}

static void factorise(const Chain *c, long first)
{
    const long rows = c->dofs - c->cut;
    const abreast *column = (const abreast *)c->column;
    abreast *reduced = (abreast *)c->reduced, *corner = (abreast *)c->corner;
    EACH(g, GROUPS)
        factor(first, rows, (abreast *)c->L + g);
    if (!c->cut)
        return;
    forth_and_back(1, rows, (const abreast *)c->L, column, reduced);
    EACH(g, GROUPS) {
        for (long i = 0; i < rows; ++i)
            corner[g] -= column[i * GROUPS + g] * reduced[i * GROUPS + g];
        corner[g] = reciprocal(corner[g]);
    }
}
