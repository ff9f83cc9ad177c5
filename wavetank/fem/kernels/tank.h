/* Structs of a translation unit, filled by Python, and macros of all templates; see wavetank/fem/codegen.py.

REAL is double; there are the same structs of float, float_Cells and so on. */
#include <math.h>
#include <stdint.h>
#include <string.h>

#define EACH(i, most) for (int i = 0; i < (int)(most); ++i)
#define INLINE static inline __attribute__((always_inline))
#define SHARED static __attribute__((unused))   /* unused in some kinds of tanks */
#define UNUSED __attribute__((unused))
#define NOINLINE static __attribute__((noinline))
#define ROLLED _Pragma("GCC unroll 1")          /* otherwise the compiler spills registers */
#define PICK __builtin_shufflevector

/* Cells of a rank in batches; see wavetank/fem/cells.py. */
typedef struct {
    int batches;
    const int *dofs;        /* [batch][node][lane] */
    const REAL *values;     /* [point][node], or [point of an edge][node of an edge] */
    const REAL *slopes;     /* [axis][point][node] in reference coordinates, or [point of an edge][node] */
    const REAL *weights;    /* [point] */
    const REAL *inverse;    /* [batch][point, or 1][axis of space][axis of cell][lane]: inverse Jacobian */
    const REAL *measure;    /* [batch][point, or 1][lane]: determinant */
} Cells;

/* Symmetric banded systems along a slice or ring. Rows are in the order of positions. A ring is cut: one row is a border, the
   last. */
typedef struct {
    int dofs, cut;          /* cut: 1 for a ring, else 0 */
    const int *row;         /* [degree of freedom] */
    REAL *L;                /* [row][distance to the column before][system]: the matrices, then their factors L D L', the
                               reciprocals of D on the diagonal */
    REAL *column;           /* [row][system]: the border */
    REAL *reduced;          /* the inverse of the band times the border */
    REAL *corner;           /* [system]: diagonal entry of the border; then the reciprocal of its Schur complement */
} Chain;

/* Levels of the column, and constants of the layer's energy. */
typedef struct {
    const REAL *zeta;       /* [level] */
    const REAL *weights;    /* [level] */
    const REAL *P, *dP;     /* [level][component] */
    const REAL *constants;
} Layers;

/* The gradient-jump penalty N along a slice; see wavetank/fem/gradient_jumps.py. */
typedef struct {
    int facets;
    double strength;
    const int *dofs;        /* [facet][nodes of the cells on both sides] */
    const double *jumps;    /* coefficients of the slope, for each of these */
} Penalty;

/* A matrix-free mass matrix; on a slice or ring on one rank with its factors, or those of its sum with a penalty. */
typedef struct {
    const Cells *cells;
    int dofs, width;        /* numbers of degrees of freedom and of fields of the density */
    const double **fields;  /* [field][degree of freedom] */
    const double *constants;
    double *rows;           /* [degree of freedom][field]: fields at the last update */
    double *weights;        /* [batch][point][lane]: density times quadrature weights */
    const Chain *factors;
    double *factored;       /* the weights at the factorisation */
    double *work;           /* [degree of freedom] */
    const Penalty *penalty; /* penalty, or null */
} Mass;

/* Earlier inputs and solutions of a sequence of similar problems; see wavetank/fem/initial_guess.py. */
typedef struct {
    int inputs, rows, numbers, most;    /* size of an input; rows and columns of a solution; number of differences */
    double shortest;
    double *input, *solution;           /* the last pair */
    double *change, *products;          /* change of a new input from the last; its products with the differences, and its square */
    double *gram;                       /* [most][most]: products of the differences of inputs */
    float *input_steps, *solution_steps;/* [most]: differences of successive pairs */
} Guesses;

/* Points z with images g; see wavetank/fem/anderson.py. */
typedef struct {
    int size, most;
    double shortest;
    const double *scale;
    double *point, *image;                  /* the last pair */
    double *point_steps, *image_steps;      /* [most]: differences of successive pairs; those of images are scaled */
    double *gram, *products, *distance;     /* as above, and the scaled residual of the last image */
} Mixing;

/* Fields, [field][degree of freedom], as rows, [degree of freedom][field]. */
INLINE void interlace(int count, long dofs, const double **fields, double *rows)
{
    EACH(f, count)
        EACH(i, dofs)
            rows[i * count + f] = fields[f][i];
}

/* A moving wall of a slice; see wavetank/tank/walls/. */
typedef struct {
    const Cells *cells;             /* the cells within the reach of its mapping */
    const Layers *layers, *end;     /* levels of the water, and of the quadrature at the wall */
    int node, count;                /* degree of freedom at the wall; number of degrees of freedom of the cells */
    const int *dofs;                /* these degrees of freedom */
    const double **fields;          /* [field][degree of freedom] */
    double *rows;                   /* [degree of freedom][field] */
    const double *moves;            /* X_p, X_p', X_p'' [m, m/s, m/s2] */
    const double *blending;         /* [degree of freedom]: s */
    double *position, *speed;       /* [degree of freedom]: s X_p, s X_p' */
    double at_still_water, slope, mean; /* mode shape f: f(0), f'(0), and its mean below still water */
    double *by_potential, *by_column;   /* [degree of freedom][component], [degree of freedom]: derivatives of W */
} Wall;
