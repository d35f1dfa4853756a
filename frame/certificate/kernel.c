/* Examination of boxes in the branch and bound of modal models; numpy_kernel.py is its twin.

A row is a box at a time node; its items are outputs and sides that are still open there. An item is
closed (0), to be split along an axis (1 + axis), or confined to faces of the box
(FACES + sum of 3^axis times 1 for the lower and 2 for the upper face). Items of one box and output
are examined eight at a time, each in its own lane. */

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define MOST 6   /* parameters */
#define LANES 8
#define FACES 16
#define SWEEPS 8
#define NEAR 2.0 /* radii within which the best point counts as near */
#define TURN 4.0 /* radians within which modes are turned */
#define INLINE static inline __attribute__((always_inline))

typedef double lane __attribute__((vector_size(8 * LANES)));
typedef long mask __attribute__((vector_size(8 * LANES)));

INLINE lane all(double x) { return (lane){0} + x; }
INLINE lane pick(mask yes, lane a, lane b) { return (lane)((yes & (mask)a) | (~yes & (mask)b)); }
INLINE lane size(lane x) { return (lane)((mask)x & 0x7fffffffffffffffL); }
INLINE lane lesser(lane a, lane b) { return pick(a < b, a, b); }
INLINE lane greater(lane a, lane b) { return pick(a > b, a, b); }
INLINE int any(mask x) { long sum = 0; for (int l = 0; l < LANES; l++) sum |= x[l]; return sum != 0; }
INLINE lane root(lane x) { for (int l = 0; l < LANES; l++) x[l] = sqrt(x[l]); return x; }
INLINE lane fused(lane a, lane b, lane c)
{
    for (int l = 0; l < LANES; l++) c[l] = __builtin_fma(a[l], b[l], c[l]);
    return c;
}

/* The nearest integer to |x| < 2^51, as the low bits of the sum. */
#define ROUNDER 6755399441055744.0

/* exp(x) to two units in the last place; below 1e-300 it is 1e-300 or so. */
static lane exponential(lane x)
{
    x = greater(lesser(x, all(690.0)), all(-690.0));
    lane high = x * 1.4426950408889634 + ROUNDER, n = high - ROUNDER, sum = all(1.0 / 6227020800.0);
    lane r = fused(n, all(-1.9082149292705877e-10), fused(n, all(-0.6931471803691238), x));
    static const double factorial[] = {1, 1, 2, 6, 24, 120, 720, 5040, 40320, 362880, 3628800,
                                       39916800, 479001600};
    for (int i = 12; i >= 0; i--) sum = sum * r + 1.0 / factorial[i];
    return (lane)((mask)sum + ((mask)high << 52));
}

/* cos and sin to two units in the last place, or an absolute 1e-16 times |x| / 2^50 for large x. */
static void circle(lane x, lane *cosine, lane *sine)
{
    lane high = x * 0.6366197723675814 + ROUNDER, n = high - ROUNDER;
    lane r = fused(n, all(-6.123233995736766e-17), fused(n, all(-1.5707963267948966), x));
    lane z = r * r;
    lane s = r + r * z * (-1.66666666666666324348e-01 + z * (8.33333333332248946124e-03
             + z * (-1.98412698298579493134e-04 + z * (2.75573137070700676789e-06
             + z * (-2.50507602534068634195e-08 + z * 1.58969099521155010221e-10)))));
    lane c = 1.0 - 0.5 * z + z * z * (4.16666666666666019037e-02 + z * (-1.38888888888741095749e-03
             + z * (2.48015872894767294178e-05 + z * (-2.75573143513906633035e-07
             + z * (2.08757232129817482790e-09 - z * 1.13596475577881948265e-11)))));
    mask turns = (mask)high, swapped = -(turns & 1);
    lane a = pick(swapped, s, c), b = pick(swapped, c, s);
    *cosine = (lane)((mask)a ^ (((turns + 1) & 2) << 62));
    *sine = (lane)((mask)b ^ ((turns & 2) << 62));
}

/* What the waves of all modes carry into value, gradient and Hessian of an output in a box: G.

   jets: complex eigenvalues with derivatives, n, and shares, parts n m, (q, n + parts n m);
   G: (parts, 3, n, 2, stride), of the real and of the imaginary part of a wave and of its first two
   derivatives by the eigenvalue; what it is not set here is zero. */
static void compose(int d, int n, int m, int parts, int output, int stride, const double *jets,
                    double *G)
{
    long wide = (n + (long)parts * n * m) * 2;
    int q = 1 + d + d * (d + 1) / 2;
    for (int part = 0; part < parts; part++)
        for (int k = 0; k < n; k++) {
            const double *r = jets + k * 2, *c = jets + (n + (part * n + k) * m + output) * 2;
            double *at = G + (part * 3 * n + k) * 2 * stride, *im = at + stride;
            double *first = at + 2L * n * stride, *first_im = first + stride;
            double *second = at + 4L * n * stride, *second_im = second + stride;
            for (int a = 0; a < q; a++) { /* the derivatives of the share, times the wave */
                at[a] = 2 * c[a * wide];
                im[a] = -2 * c[a * wide + 1];
            }
            for (int i = 0, a = 1 + d; i < d; i++) {
                const double *s = r + (1 + i) * wide, *u = c + (1 + i) * wide;
                double x = c[0] * s[0] - c[1] * s[1], y = c[0] * s[1] + c[1] * s[0];
                first[1 + i] = 2 * x;
                first_im[1 + i] = -2 * y;
                for (int j = i; j < d; j++, a++) {
                    const double *t = r + (1 + j) * wide, *v = c + (1 + j) * wide;
                    const double *h = r + a * wide;
                    first[a] = 2 * (u[0] * t[0] - u[1] * t[1] + v[0] * s[0] - v[1] * s[1]
                                    + c[0] * h[0] - c[1] * h[1]);
                    first_im[a] = -2 * (u[0] * t[1] + u[1] * t[0] + v[0] * s[1] + v[1] * s[0]
                                        + c[0] * h[1] + c[1] * h[0]);
                    second[a] = 2 * (x * t[0] - y * t[1]);
                    second_im[a] = -2 * (x * t[1] + y * t[0]);
                }
            }
        }
}

/* Values, gradients and Hessians at the lanes from their waves. */
static void taylor(int terms, int stride, const double *G, const lane *w, lane *J)
{
    for (int begin = 0; begin < stride; begin += 8) {
        lane sum[8] = {{0}};
        for (int k = 0; k < terms; k++)
            for (int a = 0; a < 8; a++)
                sum[a] += w[k] * G[k * stride + begin + a];
        memcpy(J + begin, sum, sizeof sum);
    }
}

/* Whether g.x + x.H.x/2 <= allowed for low <= x <= high is shown by a concave function above it:
   the quadratic plus s_i (x_i - low_i)(high_i - x_i)/2 (alpha-BB), and its tangents. Axes that are
   not `wide` have no width. */
static mask stays_below(int d, const int *wide, const lane *g, lane H[][MOST], const lane *low,
                        const lane *high, lane allowed, mask open)
{
    lane shift[MOST], slope[MOST], x[MOST], L[MOST][MOST], value = {0};
    mask below = {0};
    open &= allowed > 0;
    for (int i = 0; i < d; i++) {
        lane width = high[i] - low[i], zero = {0};
        x[i] = greater(lesser(zero, high[i]), low[i]);
        shift[i] = zero;
        if (!wide[i]) continue;
        mask outward = ((high[i] <= 0) & (g[i] > 0)) | ((low[i] >= 0) & (g[i] < 0));
        shift[i] = allowed / (d * width * width) + pick(outward, size(g[i]) / width, zero);
    }
    for (int i = 0; i < d; i++) /* Cholesky of shift - H on the axes with a width */
        for (int j = 0; j <= i; j++) {
            if (!wide[i] || !wide[j]) continue;
            lane sum = i == j ? shift[i] - H[i][j] : -H[i][j];
            for (int k = 0; k < j; k++)
                if (wide[k]) sum -= L[i][k] * L[j][k];
            if (i == j) {
                open &= sum > 1e-12 * (shift[i] + size(H[i][i]));
                L[i][i] = 1.0 / root(sum);
            } else
                L[i][j] = sum * L[j][j];
        }
    if (!any(open)) return below;
    for (int i = 0; i < d; i++) {
        lane bent = {0};
        for (int j = 0; j < d; j++)
            bent += H[i][j] * x[j];
        value += (g[i] + 0.5 * bent) * x[i] + 0.5 * shift[i] * (x[i] - low[i]) * (high[i] - x[i]);
        slope[i] = g[i] + bent + 0.5 * shift[i] * (low[i] + high[i] - 2 * x[i]);
    }
    for (int sweep = 0; sweep < SWEEPS; sweep++) {
        lane tangent = value;
        for (int i = 0; i < d; i++)
            if (wide[i]) tangent += greater(slope[i] * (high[i] - x[i]), slope[i] * (low[i] - x[i]));
        below |= open & (tangent <= allowed);
        open &= (tangent > allowed) & (value <= allowed);
        if (!any(open)) break;
        for (int i = 0; i < d; i++) {
            if (!wide[i]) continue;
            lane bend = shift[i] - H[i][i];
            lane next = greater(lesser(x[i] + slope[i] / bend, high[i]), low[i]), step = next - x[i];
            value += step * (slope[i] - 0.5 * bend * step);
            x[i] = next;
            for (int j = 0; j < d; j++)
                slope[j] += H[j][i] * step;
            slope[i] -= shift[i] * step;
        }
    }
    return below;
}

/* Upper bound of f + g.x + x.H.x/2 for |x| <= r: mixed terms of H moved to its diagonal. */
static lane separable(int d, const double *r, lane f, const lane *g, lane H[][MOST])
{
    for (int i = 0; i < d; i++) {
        if (!(r[i] > 0)) continue;
        lane bend = H[i][i], slope = size(g[i]);
        for (int j = 0; j < d; j++)
            if (j != i) bend += size(H[i][j]) * (r[j] / r[i]);
        mask inside = (bend < 0) & (slope < -bend * r[i]);
        f += pick(inside, -slope * slope / (2 * bend), slope * r[i] + 0.5 * bend * (r[i] * r[i]));
    }
    return f;
}

/* Bounds over the domain that `turned` needs: of eigenvalues, orders 2 and 3, (d, d, n) and so on,
   and of shares, orders 0 to 3. */
typedef struct { const double *rate2, *rate3, *share0, *share1, *share2, *share3; } suprema;

/* A mode over a box: twice its share at the centre, slopes of its phase over time, their reach, and
   the bounds of `suprema` times radii. */
typedef struct { double re, im, slope[MOST], reach, e1, e2, e3, c0, c1, c2, c3; } mode;

/* A tensor of bounds, `order` axes and `count` columns, times radii along all axes. */
static void contracted(int d, int order, int count, const double *tensor, const double *r, double *sum)
{
    int all = 1;
    for (int i = 0; i < order; i++) all *= d;
    memset(sum, 0, count * sizeof *sum);
    for (int a = 0; a < all; a++, tensor += count) {
        double weight = 1.0;
        for (int i = 0, b = a; i < order; i++, b /= d) weight *= r[b % d];
        for (int k = 0; k < count; k++) sum[k] += weight * tensor[k];
    }
}

/* The modes of all outputs, (m, n); sums: room for 2 n + 3 n m numbers. */
static void turning(int d, int n, int m, const double *r, const double *before, const double *jets,
                    const suprema *s, double *sums, mode *modes)
{
    long wide = (n + (long)n * m) * 2;
    double *e2 = sums, *e3 = e2 + n, *c1 = e3 + n, *c2 = c1 + n * m, *c3 = c2 + n * m;
    if (memcmp(r, before, d * sizeof *r)) { /* else the sums are those of the box before */
        contracted(d, 2, n, s->rate2, r, e2);
        contracted(d, 3, n, s->rate3, r, e3);
        contracted(d, 1, n * m, s->share1, r, c1);
        contracted(d, 2, n * m, s->share2, r, c2);
        contracted(d, 3, n * m, s->share3, r, c3);
    }
    for (int output = 0; output < m; output++)
        for (int k = 0; k < n; k++, modes++) {
            int own = k * m + output;
            const double *share = jets + (n + own) * 2;
            *modes = (mode){2 * share[0], 2 * share[1], {0}, 0, 0, e2[k], e3[k], s->share0[own],
                            c1[own], c2[own], c3[own]};
            for (int i = 0; i < d; i++) {
                const double *rate = jets + (1 + i) * wide + k * 2;
                modes->e1 += fabs(rate[0]) * r[i];
                modes->slope[i] = rate[1];
                modes->reach += fabs(rate[1]) * r[i];
            }
        }
}

/* Bound of what a mode of amplitude `w` leaves out beside its turning share at the centre, see
   `Turning.rest`; infinite beyond TURN. */
static lane left_out(const mode *o, lane t, lane w)
{
    lane reach = o->reach * t, z0 = (o->e1 + o->e2 / 2) * t, z1 = (o->e1 + o->e2) * t;
    lane e2 = o->e2 * t, e3 = o->e3 * t, swell = 1.0 + z0 + z0 * z0; /* above exp(z0) up to 1.7 */
    lane p0 = o->c1 + o->c0 * z0 * swell, p1 = o->c1 + o->c0 * z1;
    lane curved = e2 + z1 * z1;
    lane p2 = o->c2 + 2 * o->c1 * z1 + o->c0 * curved;
    lane p3 = o->c3 + 3 * o->c2 * z1 + 3 * o->c1 * curved
              + o->c0 * (e3 + 3 * e2 * z1 + z1 * z1 * z1);
    lane sum = reach * reach * (reach * p0 + 3 * p1 * swell) + (3 * reach * p2 + p3) * swell;
    return pick((reach < TURN) & (z0 < 1.7), w * sum / 3, all(INFINITY));
}

typedef struct {
    long boxes, nodes;
    int d, n, m, parts, started;
    const long *row_start, *item_start, *row_node;
    const int *column;
    const double *jets, *time, *forced, *third, *margin, *centre, *radius;
    const unsigned char *edges;
    const double *best, *point, *best_jets;
    suprema over;
    double gap;
    int *code;
    double *value;
} work;

/* Waves of all modes, their derivatives by the eigenvalue and parts, at the rows of the lanes. */
static void waves(const work *o, const double *jets, const long *row, lane t, lane *w)
{
    int n = o->n, part = 0;
    if (o->started) {
        part = 1;
        for (int k = 0; k < n; k++) {
            lane turned, risen, grown = exponential(t * jets[2 * k]);
            circle(t * jets[2 * k + 1], &turned, &risen);
            for (int order = 0; order < 3; order++, grown *= t) {
                w[(order * n + k) * 2] = grown * turned;
                w[(order * n + k) * 2 + 1] = grown * risen;
            }
        }
    }
    if (part < o->parts)
        for (int l = 0; l < LANES; l++)
            for (int i = 0; i < 6 * n; i++)
                w[part * 6 * n + i][l] = o->forced[row[l] * 6 * n + i];
}

/* Rising axes i <= j <= k; for each of them half the orders of the two others, once where axes are the
   same, and that times their radii. After the last triple i is -1. */
typedef struct { int i, j, k; double orders[3], along[3]; } triple;

static void all_triples(int d, triple *of)
{
    for (int i = 0; i < d; i++)
        for (int j = i; j < d; j++)
            for (int k = j; k < d; k++)
                *of++ = (triple){i, j, k, {j == k ? 0.5 : 1.0, j > i ? 1.0 : 0.0,
                                           k > j ? (i == j ? 0.5 : 1.0) : 0.0}, {0}};
    of->i = -1;
}

/* Examine the items of up to LANES rows of a box and output: both sides, those without an item
   marked by -1. */
static void lanes(int d, const work *o, long box, int output, const long *row, long item[2][LANES],
                  const double *table, int stride, const mode *modes, const triple *triples, lane *w)
{
    int q = 1 + d + d * (d + 1) / 2, m = o->m, n = o->n, wide[MOST];
    const double *c = o->centre + box * d, *r = o->radius + box * d;
    const double *jets = o->jets + box * q * (n + (long)o->parts * n * m) * 2;
    const unsigned char *edge = o->edges + 2 * box * d;
    long node[LANES];
    lane t, J[32], H[MOST][MOST], bent[MOST], cubic[MOST], rest;
    lane third[MOST * (MOST + 1) * (MOST + 2) / 6], *T = third;
    for (int l = 0; l < LANES; l++) {
        node[l] = o->row_node[row[l]];
        t[l] = o->time[node[l]];
        rest[l] = o->margin[(node[l] * m + output) * (1 + d)];
    }
    lane noise = rest;
    waves(o, jets, row, t, w);
    taylor(6 * o->parts * n, stride, table, w, J);
    for (int i = 0, a = 1 + d; i < d; i++) {
        wide[i] = r[i] > 0;
        cubic[i] = all(0.0);
        for (int j = i; j < d; j++)
            H[i][j] = H[j][i] = J[a++];
    }
    const double *bound = o->third + output * (d * (d + 1L) * (d + 2) / 6) * o->nodes;
    for (const triple *of = triples; of->i >= 0; of++, bound += o->nodes, T++) {
        for (int l = 0; l < LANES; l++)
            (*T)[l] = bound[node[l]];
        cubic[of->i] += *T * of->along[0];
        cubic[of->j] += *T * of->along[1];
        cubic[of->k] += *T * of->along[2];
    }
    for (int i = 0; i < d; i++) {
        rest += cubic[i] * (r[i] / 3);
        bent[i] = all(0.0);
        for (int j = 0; j < d; j++)
            bent[i] += size(H[i][j]) * r[j];
        for (int l = 0; l < LANES; l++)
            cubic[i][l] += o->margin[(node[l] * m + output) * (1 + d) + 1 + i];
    }
    for (int up = 0; up < 2; up++) {
        double side = up ? 1.0 : -1.0;
        lane f = side * J[0], best = {0}, g[MOST], S[MOST][MOST], low[MOST], high[MOST];
        long problem[LANES];
        mask open, faces = {0};
        for (int l = 0; l < LANES; l++) {
            problem[l] = (node[l] * m + output) * 2 + up;
            best[l] = o->best[problem[l]];
            open[l] = -(item[up][l] >= 0);
        }
        if (!any(open)) continue;
        lane target = best + o->gap;
        long place = 1;
        for (int i = 0; i < d; i++, place *= 3) {
            g[i] = side * J[1 + i];
            low[i] = all(-r[i]);
            high[i] = all(r[i]);
            for (int j = 0; j < d; j++)
                S[i][j] = side * H[i][j];
            if (!wide[i]) continue;
            mask rising = size(g[i]) > bent[i] + cubic[i], more = g[i] > 0;
            faces += rising & (edge[d + i] ? more & (2 * place) : more & 0);
            faces += rising & (edge[i] ? ~more & place : more & 0);
            /* the neighbour holds higher points */
            open &= ~(rising & ((edge[d + i] ? more & 0 : more) | (edge[i] ? more & 0 : ~more)));
        }
        open &= separable(d, r, f, g, S) + rest > target;
        if (modes && any(open)) { /* modes that turn at constant rates, the rest as a remainder */
            lane start = f, left = noise, slope[MOST], bend[MOST][MOST];
            memcpy(slope, g, sizeof slope);
            memcpy(bend, S, sizeof bend);
            for (int k = 0; k < n; k++) {
                const mode *of = modes + k;
                lane x = side * (of->re * w[2 * k] - of->im * w[2 * k + 1]);
                lane y = side * (of->re * w[2 * k + 1] + of->im * w[2 * k]);
                lane reach = of->reach * t, square = reach * reach;
                left += left_out(of, t, root(w[2 * k] * w[2 * k] + w[2 * k + 1] * w[2 * k + 1]));
                left += square * square * (size(y) * (reach / 120) + size(x) * (square / 720));
                start += size(y) * (square * reach / 24);
                lane tilt = y * square * t / 8, soft = greater(x, all(0.0)) * square * t * t / 12;
                for (int i = 0; i < d; i++) {
                    slope[i] += tilt * of->slope[i];
                    for (int j = 0; j < d; j++)
                        bend[i][j] += soft * (of->slope[i] * of->slope[j]);
                }
            }
            open &= ~(separable(d, r, start, slope, bend) + left <= target);
            open &= ~stays_below(d, wide, slope, bend, low, high, target - start - left, open);
        }
        mask whole = open & (faces == 0);
        if (any(whole))
            whole &= ~stays_below(d, wide, g, S, low, high, target - f - rest, whole);
        mask near = whole;
        lane span[MOST], excess, room, J[32];
        for (int i = 0; i < d && any(near); i++) {
            lane at;
            for (int l = 0; l < LANES; l++)
                at[l] = o->point[problem[l] * d + i];
            low[i] = c[i] - r[i] - at;
            high[i] = c[i] + r[i] - at;
            near &= greater(low[i], -high[i]) <= NEAR * r[i] + 1e-12;
            span[i] = greater(greater(size(low[i]), size(high[i])), all(1e-9));
        }
        if (any(near)) {
            lane bend[MOST] = {{0}};
            T = third;
            for (const triple *of = triples; of->i >= 0; of++, T++) {
                bend[of->i] += *T * span[of->j] * span[of->k] * (2 * of->orders[0]);
                bend[of->j] += *T * span[of->i] * span[of->k] * (2 * of->orders[1]);
                bend[of->k] += *T * span[of->i] * span[of->j] * (2 * of->orders[2]);
            }
            for (int a = 0; a < q; a++)
                for (int l = 0; l < LANES; l++)
                    J[a][l] = o->best_jets[problem[l] * q + a];
            for (int i = 0, a = 1 + d; i < d; i++) {
                g[i] = side * J[1 + i];
                for (int j = i; j < d; j++)
                    S[i][j] = S[j][i] = side * J[a++];
                S[i][i] += bend[i] / span[i] / 3; /* the cubic remainder: sum of bend_i x_i^2 / 6 */
            }
            excess = side * J[0] - best;
            room = o->gap - noise - excess;
            whole &= ~stays_below(d, wide, g, S, low, high, room, near);
        }
        lane most = all(-1.0);
        mask axis = {0};
        for (int i = 0; i < d; i++) {
            if (!wide[i]) continue;
            lane weight = r[i] * (2 * cubic[i] + 0.5 * bent[i]);
            axis = (mask)pick(weight > most, (lane)((mask){0} + i), (lane)axis);
            most = greater(weight, most);
        }
        for (int l = 0; l < LANES; l++) {
            if (item[up][l] < 0) continue;
            o->value[item[up][l]] = f[l];
            o->code[item[up][l]] = whole[l] ? 1 + axis[l] : open[l] && faces[l] ? FACES + faces[l] : 0;
        }
    }
}

/* All rows of a box that have an item of an output, LANES at a time. */
static void rows(int d, const work *o, long box, int output, const double *table, int stride,
                 const mode *modes, const triple *triples, lane *w)
{
    long row[LANES], item[2][LANES];
    int count = 0;
    for (long at = o->row_start[box]; at < o->row_start[box + 1]; at++) {
        long own[2] = {-1, -1};
        for (long i = o->item_start[at]; i < o->item_start[at + 1]; i++)
            if (o->column[i] / 2 == output) own[o->column[i] % 2] = i;
        if (own[0] >= 0 || own[1] >= 0) {
            row[count] = at;
            item[0][count] = own[0];
            item[1][count++] = own[1];
        }
        if (count == LANES || (count && at + 1 == o->row_start[box + 1])) {
            for (int l = count; l < LANES; l++) {
                row[l] = row[0];
                item[0][l] = item[1][l] = -1;
            }
            lanes(d, o, box, output, row, item, table, stride, modes, triples, w);
            count = 0;
        }
    }
}

static int has(const work *o, long box, int output)
{
    for (long i = o->item_start[o->row_start[box]]; i < o->item_start[o->row_start[box + 1]]; i++)
        if (o->column[i] / 2 == output) return 1;
    return 0;
}

/* Examine all items of some boxes; returns 1, or 0 where memory fails.

   row_start, item_start: first row of each box and first item of each row. jets: (boxes, q, n +
   parts n m), complex. forced: waves under a load, (rows, 3, n), complex. third: bounds of third
   derivatives (m, triples of rising axes, nodes); margin: for rounding of values and slopes, (nodes,
   m, 1 + d). edges: whether the lower and the upper face of a box lie on that of the domain,
   (boxes, 2, d). Of each problem, by node, output and side (lower first): value, point (d), and the
   jet of the output there (q). */
int examine(long boxes, long nodes, int d, int n, int m, int parts, int started,
            const long *row_start, const long *item_start, const long *row_node, const int *column,
            const double *jets, const double *time, const double *forced, const double *third,
            const double *margin, const double *centre, const double *radius,
            const unsigned char *edges, const double *best, const double *point,
            const double *best_jets, const double *rate2, const double *rate3,
            const double *share0, const double *share1, const double *share2, const double *share3,
            double gap, int *code, double *value)
{
    work o = {boxes, nodes, d, n, m, parts, started, row_start, item_start, row_node, column, jets,
              time, forced, third, margin, centre, radius, edges, best, point, best_jets,
              {rate2, rate3, share0, share1, share2, share3}, gap, code, value};
    int q = 1 + d + d * (d + 1) / 2, terms = 6 * parts * n, stride = (q + 7) / 8 * 8;
    long wide = (n + (long)parts * n * m) * 2;
    size_t numbers = terms * (LANES + stride) + n * (2 + 3 * m) + 7;
    lane *w = aligned_alloc(64, numbers / 8 * 64);
    mode *modes = malloc(n * m * sizeof *modes);
    if (!w || !modes) {
        free(w);
        free(modes);
        return 0;
    }
    memset(w, 0, numbers / 8 * 64);
    double *G = (double *)(w + terms), *sums = G + terms * stride;
    const double zero[MOST] = {0};
    triple triples[MOST * (MOST + 1) * (MOST + 2) / 6 + 1];
    all_triples(d, triples);
    for (long box = 0; box < boxes; box++) {
        const double *own = jets + box * q * wide;
        if (rate2) turning(d, n, m, radius + box * d, box ? radius + (box - 1) * d : zero, own, &o.over,
                           sums, modes);
        for (triple *of = triples; of->i >= 0; of++) {
            const double *r = radius + box * d;
            of->along[0] = of->orders[0] * r[of->j] * r[of->k];
            of->along[1] = of->orders[1] * r[of->i] * r[of->k];
            of->along[2] = of->orders[2] * r[of->i] * r[of->j];
        }
        for (int output = 0; output < m; output++) {
            if (!has(&o, box, output)) continue;
            compose(d, n, m, parts, output, stride, own, G);
            const mode *of = rate2 ? modes + output * n : 0;
            rows(d, &o, box, output, G, stride, of, triples, w);
        }
    }
    free(modes);
    free(w);
    return 1;
}
