/* What carried_waves.py does, where all of it is along a slice or ring on this rank: functions of other kernels one after the
other, which are known by where they are. */
#include <string.h>

typedef void Solve(const void *chain, const double *b, double *x, double *work);
typedef void Multiply(const void *cells, const double *weights, const double *x, double *y);
typedef void Respond(const void *chain, const double *shares, const double *right, double *x, double *work);
typedef void Carry(const void *cells, const double *velocity, int slopes, const double *x, double *y);
typedef double Move(const void *cells, double most, const double *axis, const double *surface,
                    double *velocity, double *y);

#define EACH(i, most) for (long i = 0; i < (most); ++i)

static void apply(const Inverse *w, const double *weights, const double *x, double *y)
{
    memset(y, 0, sizeof(double) * w->dofs);
    ((Multiply *)w->multiply)(w->mass_cells, weights, x, y);
}

static void solve(const Inverse *w, const double *b, double *x)
{
    ((Solve *)w->solve_mass)(w->mass, b, x, w->mass_work);
}

/* y = a int V . grad x v dX, or, not ``slopes``, a int x V . grad v dX. */
static void carry(const Inverse *w, double a, int slopes, const double *x, double *y)
{
    memset(y, 0, sizeof(double) * w->dofs);
    ((Carry *)w->carry)(w->cells, w->velocity, slopes, x, y);
    EACH(i, w->dofs)
        y[i] *= a;
}

/* The velocities at the surface of a state, cut off at ``most``. Returns the largest along the bottom. */
static double look(const Inverse *w, double most, const double *eta, const double *psi, const double *rate,
                   const double *walls)
{
    const long n = w->dofs, fields = w->fields;
    double *surface = w->room, *B = w->vertical;
    solve(w, rate, B);
    EACH(i, n) {
        double *at = surface + fields * i;
        at[0] = eta[i], at[1] = psi[i], at[2] = B[i];
        for (long k = 3; k < fields; ++k)
            at[k] = walls[(k - 3) * n + i];
    }
    memset(B, 0, sizeof(double) * n);
    const double fastest = ((Move *)w->move)(w->cells, most, w->axis, surface, w->velocity, B);
    solve(w, B, B);
    EACH(i, n)
        B[i] = B[i] > most ? most : B[i] < -most ? -most : B[i];
    return fastest;
}

/* The residual of a stage of weight a, [Q, psi], preconditioned; ``carried`` by the current, or not. */
static void precondition(const Inverse *w, double a, int carried, const double *residual, double *found)
{
    const long n = w->dofs;
    const double *B = w->vertical, *q = residual, *psi = residual + n, g = w->gravity;
    double *eta = w->room, *r_chi = eta + n, *work = r_chi + n, *kept = found, *chi = found + n, made = 0.0;
    memcpy(r_chi, psi, sizeof(double) * n);
    const int moves = w->at_rest != w->weights;
    if (carried || moves)
        solve(w, q, work);
    if (carried)
        EACH(i, n)
            r_chi[i] -= B[i] * work[i];
    if (moves) {
        EACH(i, n)
            eta[i] = r_chi[i] / (a * a * g) - work[i] / a;
        apply(w, w->at_rest, eta, work);
    } else {
        apply(w, w->weights, r_chi, work);
        EACH(i, n)
            work[i] = work[i] / (a * a * g) - q[i] / a;
    }
    ((Respond *)w->respond)(w->modes, w->shares, work, chi, w->modes_work);
    EACH(i, n)
        eta[i] = (r_chi[i] - chi[i]) / (a * g);
    apply(w, w->weights, eta, kept);
    if (carried) {
        carry(w, a, 1, chi, work);
        solve(w, work, work);
        EACH(i, n)
            chi[i] -= work[i];
        carry(w, a, 0, eta, work);
        EACH(i, n)
            kept[i] += work[i];
        solve(w, work, work);
        EACH(i, n)
            chi[i] += B[i] * (eta[i] + work[i]);
    }
    EACH(i, n)
        made += kept[i] - q[i];
    EACH(i, n)
        kept[i] -= w->uniform[i] * (made / w->of_metre);
}
