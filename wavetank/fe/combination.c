/* Points combined as their images come closest to what is asked for, of wavetank/fe/combination.py; nearest.c stands before.

points, images  [which][number]: the newest, and behind it differences of those before, images' in their ``scale`` */

#define FEW 512  /* numbers at a time */

static void multiply(long size, int known, const double *differences, const double *restrict x, double *products)
{
    for (int k = 0; k < known; ++k) {
        const double *restrict one = differences + k * size;
        double sum = 0.0;
        for (long i = 0; i < size; ++i)
            sum += one[i] * x[i];
        products[k] = sum;
    }
}

/* A point becomes the newest, the way to it the difference at a place; its image's products with those known. */
static void add(long size, int known, int place, const double *restrict scale, const double *restrict z,
                const double *restrict image, double *points, double *images, double *products)
{
    double *restrict way = points + (1 + place) * size, *restrict difference = images + (1 + place) * size;
    for (long i = 0; i < size; ++i) {
        way[i] = z[i] - points[i], difference[i] = (image[i] - images[i]) / scale[i];
        points[i] = z[i], images[i] = image[i];
    }
    multiply(size, known, images + size, difference, products);
}

/* away = (c - the newest image) / scale, and its products with those known and itself. */
static void aim(long size, int known, const double *restrict scale, const double *restrict c, const double *images,
                double *restrict away, double *products)
{
    double square = 0.0;
    for (long i = 0; i < size; ++i) {
        away[i] = (c[i] - images[i]) / scale[i];
        square += away[i] * away[i];
    }
    multiply(size, known, images + size, away, products);
    products[known] = square;
}

/* z = the points combined as their images come closest to what was aimed at, ``wrong`` a square; what is missed of that. */
static void combine(long size, int known, int stride, const double *gram, const double *products, double wrong,
                    double shortest, const double *restrict scale, const double *restrict away, const double *points,
                    const double *images, double *restrict z, double *restrict missed)
{
    double A[stride * stride], weights[stride];
    for (int i = 0; i < known; ++i)
        for (int j = 0; j < known; ++j)
            A[i * stride + j] = gram[i * stride + j] + (i == j ? wrong : 0.0);
    nearest(known, stride, A, products, shortest, weights);
    for (long begin = 0; begin < size; begin += FEW) {
        const long end = begin + FEW < size ? begin + FEW : size;
        for (long i = begin; i < end; ++i)
            z[i] = points[i], missed[i] = away[i];
        for (int k = 0; k < known; ++k) {
            const double *restrict way = points + (1 + k) * size, *restrict difference = images + (1 + k) * size;
            for (long i = begin; i < end; ++i)
                z[i] += weights[k] * way[i], missed[i] -= weights[k] * difference[i];
        }
        for (long i = begin; i < end; ++i)
            missed[i] *= scale[i];
    }
}
