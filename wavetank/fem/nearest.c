/* Least squares by products, for wavetank/fem/recall.py and combination.py. */
#include <math.h>

/* Weights of vectors whose combination comes closest to a target, of products with each other, rows of ``stride``, and with
   it: Cholesky's factors L of those, the longest of what is left of them first; one of which a square below ``shortest`` of
   that of the longest is left takes no part. */
static void nearest(int count, int stride, const double *gram, const double *along, double shortest, double *weights)
{
    if (count < 1)
        return;
    double L[count][count], left[count], longest = 0.0;
    int order[count], taken = 0;
    for (int i = 0; i < count; ++i) {
        left[i] = gram[i * stride + i], longest = left[i] > longest ? left[i] : longest;
        order[i] = i, weights[i] = 0.0;
    }
    for (; taken < count; ++taken) {
        int most = taken;
        for (int i = taken; i < count; ++i)
            most = left[order[i]] > left[order[most]] ? i : most;
        const int next = order[most];
        if (!(left[next] > shortest * longest))
            break;
        order[most] = order[taken], order[taken] = next;
        L[next][taken] = sqrt(left[next]);
        weights[next] = along[next];
        for (int k = 0; k < taken; ++k)
            weights[next] -= L[next][k] * weights[order[k]];
        weights[next] /= L[next][taken];
        for (int i = taken + 1; i < count; ++i) {
            const int other = order[i];
            double sum = gram[other * stride + next];
            for (int k = 0; k < taken; ++k)
                sum -= L[other][k] * L[next][k];
            L[other][taken] = sum / L[next][taken];
            left[other] -= L[other][taken] * L[other][taken];
        }
    }
    for (int i = taken - 1; i >= 0; --i) {
        const int last = order[i];
        for (int k = i + 1; k < taken; ++k)
            weights[last] -= L[order[k]][i] * weights[order[k]];
        weights[last] /= L[last][i];
    }
}
