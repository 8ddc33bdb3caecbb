/* One residual-and-sensitivity evaluation of a move, as one would write it in C: the elements led
 * through the samples, derivatives by Fc and sigma0 carried along, the residual whitened by the
 * banded Cholesky factor (made before, like the estimator's), J'J and J'r summed up. The same
 * horizon, unknowns and shortcut (far above the Stribeck velocity all elements relax together) as
 * the estimator's. */
#include <math.h>
#include <string.h>

#define N 4
#define UNKNOWNS 4
#define SUBSTEPS 4

typedef struct {
    double alpha, vs, rate, period, band, fast_speed;
} Constants;

static void evaluate(const double *x, const double *v, const double *a, const double *u, int count,
                     int begin, const double *factor, const double *p, const double *scale,
                     const Constants *c, double *normal, double *slope, double *chi)
{
    const double fc = p[0] * scale[0], sv = p[1] * scale[1], s0 = p[2] * scale[2] / N,
                 mass = p[3] * scale[3], share = 1.0 / N;
    const double fast_decay = exp(-c->rate * c->period);
    double nu[N], f[N] = {0}, by_fc[N] = {0}, by_s0[N] = {0};
    int slips[N] = {0}, all = 0;
    double owed = 1.0, heading = 0.0, reference = x[0], total = 0.0, t_fc = 0.0, t_s0 = 0.0;
    double w1[UNKNOWNS + 1] = {0}, w2[UNKNOWNS + 1] = {0};
    memset(normal, 0, UNKNOWNS * UNKNOWNS * sizeof(double));
    memset(slope, 0, UNKNOWNS * sizeof(double));
    *chi = 0.0;
    for (int i = 0; i < N; i++)
        nu[i] = 2.0 * (i + 1) / (N * (N + 1));
    for (int k = 0; k < count; k++) {
        const double moved = x[k + 1] - reference;
        if (fabs(moved) > c->band) {
            const double v1 = v[k], v0 = k ? v[k - 1] : v1;
            const double slow = fmin(v0 * heading, v1 * heading);
            reference = x[k + 1];
            if (all && slow > c->fast_speed && moved * heading > 0.0) {
                total = heading * fc + (total - heading * fc) * fast_decay;
                t_fc = heading + (t_fc - heading) * fast_decay;
                t_s0 *= fast_decay;
                owed *= fast_decay;
            } else {
                if (owed != 1.0) {
                    for (int i = 0; i < N; i++) {
                        const double goal = heading * nu[i];
                        f[i] = goal * fc + (f[i] - goal * fc) * owed;
                        by_fc[i] = goal + (by_fc[i] - goal) * owed;
                        by_s0[i] *= owed;
                    }
                    owed = 1.0;
                }
                const int steps = all && slow > 4.0 * c->vs ? 1 : SUBSTEPS;
                const double dt = c->period / steps, shift = moved / c->period - 0.5 * (v0 + v1);
                for (int j = 0; j < steps; j++) {
                    const double speed = v0 + (v1 - v0) * (j + 0.5) / steps + shift;
                    const double dx = speed * dt, direction = dx < 0.0 ? -1.0 : 1.0;
                    if (dx == 0.0)
                        continue;
                    if (direction != heading) {
                        heading = direction;
                        memset(slips, 0, sizeof slips);
                    }
                    const double curve = 1.0 + c->alpha * exp(-fabs(speed) / c->vs);
                    const double decay = exp(-c->rate * dt / curve);
                    total = t_fc = t_s0 = 0.0;
                    all = 1;
                    for (int i = 0; i < N; i++) {
                        const double goal = direction * nu[i] * curve, limit = fabs(goal) * fc;
                        if (!slips[i]) {
                            const double stretched = f[i] + s0 * dx;
                            if (stretched * direction >= limit) {
                                slips[i] = 1;
                                if (f[i] * direction < limit) {
                                    f[i] = goal * fc;
                                    by_fc[i] = goal;
                                    by_s0[i] = 0.0;
                                }
                            } else {
                                f[i] = stretched;
                                by_s0[i] += dx * share;
                                all = 0;
                            }
                        }
                        if (slips[i]) {
                            f[i] = goal * fc + (f[i] - goal * fc) * decay;
                            by_fc[i] = goal + (by_fc[i] - goal) * decay;
                            by_s0[i] *= decay;
                        }
                        total += f[i];
                        t_fc += by_fc[i];
                        t_s0 += by_s0[i];
                    }
                }
            }
        }
        if (k < begin)
            continue;
        const double *row = factor + 3 * (k - begin);
        const double second = row[0], first = row[1], inverse = row[2];
        double w[UNKNOWNS + 1] = {t_fc * scale[0], v[k] * scale[1], t_s0 * scale[2],
                                  a[k] * scale[3], total + sv * v[k] + mass * a[k] - u[k + 1]};
        for (int i = 0; i <= UNKNOWNS; i++) {
            w[i] = (w[i] - first * w1[i] - second * w2[i]) * inverse;
            w2[i] = w1[i];
            w1[i] = w[i];
        }
        *chi += w[UNKNOWNS] * w[UNKNOWNS];
        for (int i = 0; i < UNKNOWNS; i++) {
            slope[i] += w[i] * w[UNKNOWNS];
            for (int j = 0; j <= i; j++)
                normal[i * UNKNOWNS + j] += w[i] * w[j];
        }
    }
}

/* So many evaluations in a row, each at slightly other figures, so that none is left out. */
double repeat(const double *x, const double *v, const double *a, const double *u, int count,
              int begin, const double *factor, const double *p, const double *scale,
              const Constants *c, double *normal, double *slope, int times)
{
    double chi = 0.0, at[UNKNOWNS];
    memcpy(at, p, sizeof at);
    for (int i = 0; i < times; i++) {
        at[0] = p[0] * (1.0 + 1e-12 * i);
        evaluate(x, v, a, u, count, begin, factor, at, scale, c, normal, slope, &chi);
    }
    return chi;
}
