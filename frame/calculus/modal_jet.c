/* 2 Re sum of C_k w(lambda_k) with gradient and Hessian: the twin of modal_jet.py. */

#include <stdlib.h>

typedef struct { double re, im; } z;

static z times(z a, z b) { z c = {a.re * b.re - a.im * b.im, a.re * b.im + a.im * b.re}; return c; }

static double real(z a, z b) { return a.re * b.re - a.im * b.im; }

/* value (count, width), first (count, d, width), second (count, pairs i <= j, width): lambda_k in
   column k, C_k in column from + k; waves (3, count, n): w and its derivatives; f, g, H are added. */
int modal_jet(long count, int d, int n, int width, int from, const double *value,
              const double *first, const double *second, const double *waves, double *f, double *g,
              double *H)
{
    int pairs = d * (d + 1) / 2;
    const z *v = (const z *)value, *one = (const z *)first, *two = (const z *)second;
    const z *w = (const z *)waves, *dw = w + count * n, *ddw = dw + count * n;
    for (long p = 0; p < count; p++)
        for (int k = 0; k < n; k++) {
            const z *rate = one + p * d * width + k, *share = rate + from;
            const z *bent = two + p * pairs * width + k, *curved = bent + from;
            z wave = w[p * n + k], slope = dw[p * n + k], own = v[p * width + from + k];
            z inner = times(own, slope), outer = times(own, ddw[p * n + k]);
            wave.re *= 2; wave.im *= 2; slope.re *= 2; slope.im *= 2;
            inner.re *= 2; inner.im *= 2; outer.re *= 2; outer.im *= 2;
            f[p] += real(own, wave);
            for (int i = 0; i < d; i++) {
                z ri = rate[i * width], si = share[i * width];
                z a = times(slope, si), b = times(slope, ri), c = times(outer, ri);
                g[p * d + i] += real(si, wave) + real(inner, ri);
                a.re += c.re; a.im += c.im;
                for (int j = i; j < d; j++, bent += width, curved += width) {
                    z rj = rate[j * width], sj = share[j * width];
                    H[(p * d + i) * d + j] += real(*curved, wave) + real(inner, *bent)
                                              + real(a, rj) + real(b, sj);
                }
            }
        }
    for (long p = 0; p < count; p++)
        for (int i = 0; i < d; i++)
            for (int j = 0; j < i; j++) H[(p * d + i) * d + j] = H[(p * d + j) * d + i];
    return 1;
}

/* Value (returned) and gradient of one plane of a quadratic at u. */
static double plane(int d, const double *restrict c, const double *restrict u, double *restrict g)
{
    double sum = c[0];
    for (int i = 0; i < d; i++) g[i] = 0;
    for (int j = 0; j < d; j++) {
        const double *bent = c + 1 + d + j * d;
        for (int i = 0; i < d; i++) g[i] += u[j] * bent[i];
    }
    for (int i = 0; i < d; i++) {
        sum += u[i] * (c[1 + i] + g[i] / 2);
        g[i] += c[1 + i];
    }
    return sum;
}

/* K complex quadratics at points (count, d): coefficients (K, 2 planes, 1 + d + d d), the value in the
   middle, slopes and second derivatives; out (count, K) complex, first (count, K, 2 planes, d). */
int quadratic_values(long count, int d, int K, const double *unit, const double *given, double *out,
                     double *first)
{
    for (long p = 0; p < count; p++)
        for (int k = 0; k < 2 * K; k++) {
            long own = p * 2 * K + k;
            out[own] = plane(d, given + (long)k * (1 + d + d * d), unit + p * d, first + own * d);
        }
    return 1;
}

/* As modal_jet for quadratics: rate (n, 2, 1 + d + d d) with its first
   derivatives at the points, slopes (count, n, 2, d), share (outputs, n, 2, 1 + d + d d), output
   (count), waves (3, count, n). f, g and H are added; H is even. 0 without memory. */
int quadratic_jet(long count, int d, int n, const double *unit, const double *rate,
                  const double *slopes, const double *share, const double *output,
                  const double *waves, double *f, double *g, double *H)
{
    int width = 1 + d + d * d;
    const z *w = (const z *)waves, *dw = w + count * n, *ddw = dw + count * n;
    double *sr = malloc(2 * d * sizeof(double)), *si = sr + d;
    if (!sr) return 0;
    for (long p = 0; p < count; p++) {
        const double *u = unit + p * d;
        double *gp = g + p * d, *Hp = H + p * d * d;
        for (int k = 0; k < n; k++) {
            const double *lr = rate + 2 * k * width, *li = lr + width;
            const double *cr = share + 2 * ((long)output[p] * n + k) * width, *ci = cr + width;
            const double *rr = slopes + 2 * (p * n + k) * d, *ri = rr + d;
            z own = {plane(d, cr, u, sr), plane(d, ci, u, si)};
            z wave = w[p * n + k], slope = dw[p * n + k], outer = times(own, ddw[p * n + k]);
            z inner = times(own, slope);
            wave.re *= 2; wave.im *= 2; slope.re *= 2; slope.im *= 2;
            inner.re *= 2; inner.im *= 2; outer.re *= 2; outer.im *= 2;
            f[p] += real(own, wave);
            for (int i = 0; i < d; i++) {
                const double *lb = lr + 1 + d + i * d, *Lb = li + 1 + d + i * d;
                const double *cb = cr + 1 + d + i * d, *Cb = ci + 1 + d + i * d;
                z one = {rr[i], ri[i]}, two = {sr[i], si[i]};
                z a = times(slope, two), b = times(slope, one), c = times(outer, one);
                a.re += c.re; a.im += c.im;
                gp[i] += real(two, wave) + real(inner, one);
                double *row = Hp + i * d;
                for (int j = i; j < d; j++)
                    row[j] += cb[j] * wave.re - Cb[j] * wave.im + lb[j] * inner.re
                              - Lb[j] * inner.im + a.re * rr[j] - a.im * ri[j] + b.re * sr[j]
                              - b.im * si[j];
            }
        }
    }
    for (long p = 0; p < count; p++)
        for (int i = 0; i < d; i++)
            for (int j = 0; j < i; j++) H[(p * d + i) * d + j] = H[(p * d + j) * d + i];
    free(sr);
    return 1;
}
