/* Slopes and velocities of a surface along a slice, of wavetank/water/surface_flow.py. */

void slopes(const Lines *s, const double *rows, double *found)
{
    for (int cell = 0; cell < s->cells; ++cell) {
        double of[POINTS] = {0.0};
        for (int i = 0; i < NODES; ++i) {
            const double one = rows[s->dofs[cell * NODES + i]] * s->stretched[cell];
            for (int q = 0; q < POINTS; ++q)
                of[q] += s->slopes[i * POINTS + q] * one;
        }
        for (int q = 0; q < POINTS; ++q)
            found[cell * POINTS + q] = of[q];
    }
}

void greatest(const Lines *s, const double *slope, const double *psi_x, double *found)
{
    double fastest = 0.0, steepest = 0.0;
    for (int n = 0; n < s->cells * POINTS; ++n) {
        const double steep = fabs(slope[n]), fast = fabs(psi_x[n]) / (1.0 + steep * steep);
        steepest = steep > steepest ? steep : steepest;
        fastest = fast > fastest ? fast : fastest;
    }
    found[0] = fastest, found[1] = steepest;
}
