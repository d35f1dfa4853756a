/* What modes answer to the ground, with derivatives by their rates: the twin of LoadTable. */
#include <math.h>

typedef struct { double re, im; } z;

static z times(z a, z b) { z c = {a.re * b.re - a.im * b.im, a.re * b.im + a.im * b.re}; return c; }

/* Series of `order` terms at x, with `orders` - 1 derivatives by the rate, whose unit is 1/scale. */
static void series(int order, int orders, const z *c, z x, double scale, z *s)
{
    z f = {0, 0}, g = {0, 0}, h = {0, 0};
    for (int i = order - 1; i >= 0; i--) {
        if (orders > 1) {
            h = times(h, x); h.re += g.re; h.im += g.im;
            g = times(g, x); g.re += f.re; g.im += f.im;
        }
        f = times(f, x); f.re += c[i].re; f.im += c[i].im;
    }
    s[0] = f;
    if (orders > 1) {
        s[1].re = g.re / scale; s[1].im = g.im / scale;
        s[2].re = 2 * h.re / (scale * scale); s[2].im = 2 * h.im / (scale * scale);
    }
}

/* out: (orders, count, modes); moment: (nodes, modes, order); ends: first nodes of later windows. */
int ground_response(long count, int modes, int order, int windows, int orders, double scale,
                    double fade, const double *middle, const double *moment, const double *ends,
                    const double *time, const double *node, const double *rate, double *out)
{
    const z *mid = (const z *)middle, *table = (const z *)moment, *lam = (const z *)rate;
    z *found = (z *)out;
    for (long p = 0; p < count; p++)
        for (int k = 0; k < modes; k++) {
            long own = p * modes + k, at = (long)node[p];
            z x = {(lam[own].re - mid[k].re) / scale, (lam[own].im - mid[k].im) / scale}, s[3];
            series(order, orders, table + (at * modes + k) * order, x, scale, s);
            z R = s[0], dR = s[1], ddR = s[2];
            for (int w = 0; w < windows; w++) {
                long end = (long)ends[w];
                double tau = time[at] - time[end];
                if (tau <= 0) break;
                if (tau >= fade) continue;
                double size = exp(lam[own].re * tau), turn = lam[own].im * tau;
                z wave = {size * cos(turn), size * sin(turn)};
                series(order, orders, table + (end * modes + k) * order, x, scale, s);
                z v = times(wave, s[0]);
                R.re += v.re; R.im += v.im;
                if (orders > 1) {
                    z v1 = times(wave, s[1]), v2 = times(wave, s[2]);
                    dR.re += v1.re + tau * v.re; dR.im += v1.im + tau * v.im;
                    ddR.re += v2.re + 2 * tau * v1.re + tau * tau * v.re;
                    ddR.im += v2.im + 2 * tau * v1.im + tau * tau * v.im;
                }
            }
            found[own] = R;
            if (orders > 1) {
                found[count * modes + own] = dR;
                found[2 * count * modes + own] = ddR;
            }
        }
    return 1;
}
