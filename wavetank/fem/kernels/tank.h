/* Structs of a translation unit, filled by Python, and macros of all templates; see wavetank/fem/codegen.py.

REAL is double; there are the same structs of float, float_Cells and so on. */
#include <math.h>
#include <stdint.h>
#include <string.h>

#define EACH(i, most) for (int i = 0; i < (int)(most); ++i)
#define INLINE static inline __attribute__((always_inline))
#define SHARED static __attribute__((unused))   /* not called in every kind of tank */
#define UNUSED __attribute__((unused))
#define NOINLINE static __attribute__((noinline))
#define ROLLED _Pragma("GCC unroll 1")          /* else much is kept for later, in memory, where registers are few */
#define PICK __builtin_shufflevector

/* Cells of a rank, some at a time; see wavetank/fem/cells.py. */
typedef struct {
    int batches;
    const int *dofs;        /* [batch][node][lane] */
    const REAL *values;     /* [point][node], or [point of an edge][node of an edge] */
    const REAL *slopes;     /* [axis][point][node] in the cell's own coordinates, or [point of an edge][node] */
    const REAL *weights;    /* [point] */
    const REAL *inverse;    /* [batch][point, or 1][axis of space][axis of cell][lane]: of the Jacobian */
    const REAL *measure;    /* [batch][point, or 1][lane]: its determinant */
} Cells;

/* Symmetric banded systems along a slice or ring. Rows stand in the order in which degrees of freedom follow each other. A
   ring is cut: one of its rows borders the rest, and is last. */
typedef struct {
    int dofs, cut;          /* cut: 1 of a ring, else 0 */
    const int *row;         /* [degree of freedom] */
    REAL *L;                /* [row][distance to the column before][system]: the matrices, then their factors L D L', the
                               reciprocals of D on the diagonal */
    REAL *column;           /* [row][system]: the border */
    REAL *reduced;          /* the rest's inverse times it */
    REAL *corner;           /* [system]: of the border; then the reciprocal of what the rest leaves of it */
} Chain;

/* Levels of the column, and what the layer's energy depends on beside fields. */
typedef struct {
    const REAL *zeta;       /* [level] */
    const REAL *weights;    /* [level] */
    const REAL *P, *dP;     /* [level][number] */
    const REAL *constants;
} Layers;

/* The gradient-jump penalty N along a slice; see wavetank/fem/gradient_jumps.py. */
typedef struct {
    int facets;
    double strength;
    const int *dofs;        /* [facet][of the cell before it, and of that behind] */
    const double *jumps;    /* of the slope, of each of these */
} Penalty;

/* A mass matrix without matrix; along a slice or ring on one rank with its factors, or those of its sum with a penalty. */
typedef struct {
    const Cells *cells;
    int dofs, width;        /* degrees of freedom and fields that the density depends on */
    const double **fields;  /* [field][degree of freedom] */
    const double *constants;
    double *rows;           /* [degree of freedom][field]: the fields as they were taken over */
    double *weights;        /* [batch][point][lane]: density times weights of quadrature */
    const Chain *factors;
    double *factored;       /* the weights that the factors are of */
    double *work;           /* [degree of freedom] */
    const Penalty *penalty; /* or null */
} Mass;

/* Earlier inputs and solutions of a sequence of similar problems; see wavetank/fem/initial_guess.py. */
typedef struct {
    int inputs, rows, numbers, most;    /* numbers of an input; rows of a solution and numbers of a row; pairs, but the last */
    double shortest;
    double *input, *solution;           /* the last pair */
    double *change, *products;          /* of a new input from the last; its products with the differences, and itself */
    double *gram;                       /* [most][most]: products of the differences of inputs */
    float *input_steps, *solution_steps;/* [most]: differences of pairs, each from the next */
} Guesses;

/* Points z with images g; see wavetank/fem/anderson.py. */
typedef struct {
    int size, most;
    double shortest;
    const double *scale;
    double *point, *image;                  /* the last pair */
    double *point_steps, *image_steps;      /* [most]: differences of pairs, each from the next; of images, scaled */
    double *gram, *products, *distance;     /* as above, and from the image wanted to the last one, scaled */
} Mixing;

/* Fields, [field][degree of freedom], as rows, [degree of freedom][field]. */
INLINE void interlace(int count, long dofs, const double **fields, double *rows)
{
    EACH(f, count)
        EACH(i, dofs)
            rows[i * count + f] = fields[f][i];
}

/* A wall of a slice that moves; see wavetank/tank/walls/piston_terms.py. */
typedef struct {
    const Cells *cells;             /* those that it stretches */
    const Layers *layers, *end;     /* levels of the water, and of the rule at the wall */
    int node, count;                /* degree of freedom at the wall; degrees of freedom of the cells */
    const int *dofs;                /* these */
    const double **fields;          /* [field][degree of freedom] */
    double *rows;                   /* [degree of freedom][field] */
    const double *moves;            /* X_p, X_p', X_p'' [m, m/s, m/s2] */
    const double *blending;         /* [degree of freedom]: s */
    double *position, *speed;       /* [degree of freedom]: s X_p, s X_p' */
    double at_still_water, slope, mean; /* of the shape f: f(0), f'(0) and its mean below still water */
    double *by_potential, *by_column;   /* [degree of freedom][number], [degree of freedom]: derivatives of W */
} Wall;
