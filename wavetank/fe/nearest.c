/* Least squares by products, for wavetank/fe/recall.py and combination.py. */
#include <math.h>

/* Weights of vectors whose combination comes closest to a target, of products with each other, A of rows of ``stride``,
   and with it: directions are found by Jacobi's rotations; those whose square is below ``shortest`` of that of the
   longest take no part. */
static void nearest(int count, int stride, const double *gram, const double *along, double shortest, double *weights)
{
    double A[count][count], V[count][count], longest = 0.0;
    for (int i = 0; i < count; ++i)
        for (int j = 0; j < count; ++j)
            A[i][j] = gram[i * stride + j], V[i][j] = i == j;
    for (int sweep = 0; sweep < 30; ++sweep) {
        double off = 0.0, on = 0.0;
        for (int i = 0; i < count; ++i) {
            on += A[i][i] * A[i][i];
            for (int j = 0; j < i; ++j)
                off += A[i][j] * A[i][j];
        }
        if (!(off > 1e-30 * on))
            break;
        for (int p = 0; p < count; ++p)
            for (int q = p + 1; q < count; ++q) {
                if (A[p][q] == 0.0)
                    continue;
                const double half = 0.5 * (A[q][q] - A[p][p]) / A[p][q];
                const double t = copysign(1.0, half) / (fabs(half) + sqrt(half * half + 1.0));
                const double c = 1.0 / sqrt(t * t + 1.0), s = t * c;
                for (int i = 0; i < count; ++i) {
                    const double a = A[i][p], b = A[i][q];
                    A[i][p] = c * a - s * b, A[i][q] = s * a + c * b;
                }
                for (int i = 0; i < count; ++i) {
                    const double a = A[p][i], b = A[q][i];
                    A[p][i] = c * a - s * b, A[q][i] = s * a + c * b;
                }
                for (int i = 0; i < count; ++i) {
                    const double a = V[i][p], b = V[i][q];
                    V[i][p] = c * a - s * b, V[i][q] = s * a + c * b;
                }
            }
    }
    for (int k = 0; k < count; ++k) {
        longest = A[k][k] > longest ? A[k][k] : longest;
        weights[k] = 0.0;
    }
    for (int k = 0; k < count; ++k) {
        double part = 0.0;
        if (!(A[k][k] > shortest * longest))
            continue;
        for (int i = 0; i < count; ++i)
            part += V[i][k] * along[i];
        for (int i = 0; i < count; ++i)
            weights[i] += V[i][k] * part / A[k][k];
    }
}
