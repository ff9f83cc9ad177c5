/* Points combined as their images come closest to what is asked for, of wavetank/fem/combination.py; nearest.c stands before. */

#define FEW 512  /* numbers at a time */

/* Products with the known differences of images. */
static void multiply(const Points *p, int known, const double *restrict x)
{
    for (int k = 0; k < known; ++k) {
        const double *restrict one = p->differences + k * p->size;
        double sum = 0.0;
        for (long i = 0; i < p->size; ++i)
            sum += one[i] * x[i];
        p->products[k] = sum;
    }
}

/* A point becomes the newest, the way to it the difference at a place; its image's products with those known, here. */
static void add(const Points *p, int known, int place, const double *restrict z, const double *restrict image)
{
    double *restrict way = p->ways + place * p->size, *restrict difference = p->differences + place * p->size;
    double *restrict newest = p->newest, *restrict its_image = p->image;
    const double *restrict scale = p->scale;
    for (long i = 0; i < p->size; ++i) {
        way[i] = z[i] - newest[i], difference[i] = (image[i] - its_image[i]) / scale[i];
        newest[i] = z[i], its_image[i] = image[i];
    }
    multiply(p, known, difference);
    for (int k = 0; k < known; ++k)
        p->gram[place * p->most + k] = p->gram[k * p->most + place] = p->products[k];
}

/* How far what is asked for is from the newest image, and the products of that with those known, and itself. */
static void aim(const Points *p, int known, const double *restrict c)
{
    const double *restrict its_image = p->image, *restrict scale = p->scale;
    double *restrict away = p->away, square = 0.0;
    for (long i = 0; i < p->size; ++i) {
        away[i] = (c[i] - its_image[i]) / scale[i];
        square += away[i] * away[i];
    }
    multiply(p, known, away);
    p->products[known] = square;
}

/* z = the points combined as their images come closest to what was aimed at, ``wrong`` a square; what is missed of that. */
static void combine(const Points *p, int known, double wrong, double *restrict z, double *restrict missed)
{
    const long size = p->size;
    const int most = p->most, length = most > 0 ? most : 1;
    const double *restrict newest = p->newest, *restrict away = p->away, *restrict scale = p->scale;
    double A[length * length], weights[length];
    for (int i = 0; i < known; ++i)
        for (int j = 0; j < known; ++j)
            A[i * most + j] = p->gram[i * most + j] + (i == j ? wrong : 0.0);
    nearest(known, most, A, p->products, p->shortest, weights);
    for (long begin = 0; begin < size; begin += FEW) {
        const long end = begin + FEW < size ? begin + FEW : size;
        for (long i = begin; i < end; ++i)
            z[i] = newest[i], missed[i] = away[i];
        for (int k = 0; k < known; ++k) {
            const double *restrict way = p->ways + k * size, *restrict difference = p->differences + k * size;
            for (long i = begin; i < end; ++i)
                z[i] += weights[k] * way[i], missed[i] -= weights[k] * difference[i];
        }
        for (long i = begin; i < end; ++i)
            missed[i] *= scale[i];
    }
}
