/* 2 Re sum of C_k w(lambda_k) with gradient and Hessian: the twin of modal_jet.py. */

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
