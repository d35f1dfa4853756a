/* Examination of boxes in the branch and bound of modal models; numpy_kernel.py is its twin.

A row is a box at a time node; its items are outputs and sides that are still open there. An item is
closed (0), to be split along an axis (1 + axis), or confined to faces of the box
(FACES + sum of 3^axis times 1 for the lower and 2 for the upper face). */

#include <math.h>

#define MOST 6 /* parameters */
#define FACES 16
#define SWEEPS 8
#define NEAR 2.0 /* radii within which the best point counts as near */

/* What the waves of all modes carry into values, gradients and Hessians of boxes: G.

   rate: eigenvalues with derivatives (q, boxes, n), shares likewise (q, boxes, parts, n, m), both
   complex; G: (boxes, m, parts, 3, n, 2, q), of the real and of the imaginary part of a wave and of
   its first two derivatives by the eigenvalue. */
int compose(long boxes, int d, int n, int m, int parts, int q, const double *rate,
            const double *share, double *G)
{
    long slab = boxes * n * 2, wide = boxes * parts * n * m * 2;
    for (long box = 0; box < boxes; box++)
        for (int output = 0; output < m; output++)
            for (int part = 0; part < parts; part++)
                for (int k = 0; k < n; k++) {
                    const double *r = rate + (box * n + k) * 2;
                    const double *c = share + (((box * parts + part) * n + k) * m + output) * 2;
                    double *at = G + (((box * m + output) * parts + part) * 3 * n + k) * 2 * q;
                    double *first = at + 2L * n * q, *second = at + 4L * n * q;
                    for (int a = 0; a < q; a++) { /* the derivatives of the share, times the wave */
                        at[a] = 2 * c[a * wide];
                        at[q + a] = -2 * c[a * wide + 1];
                        first[a] = first[q + a] = second[a] = second[q + a] = 0.0;
                    }
                    for (int i = 0; i < d; i++) {
                        const double *s = r + (1 + i) * slab;
                        first[1 + i] = 2 * (c[0] * s[0] - c[1] * s[1]);
                        first[q + 1 + i] = -2 * (c[0] * s[1] + c[1] * s[0]);
                    }
                    int a = 1 + d;
                    for (int i = 0; i < d; i++)
                        for (int j = i; j < d; j++, a++) {
                            const double *s = r + (1 + i) * slab, *t = r + (1 + j) * slab;
                            const double *u = c + (1 + i) * wide, *v = c + (1 + j) * wide;
                            const double *h = r + a * slab;
                            double x = c[0] * s[0] - c[1] * s[1], y = c[0] * s[1] + c[1] * s[0];
                            first[a] = 2 * (u[0] * t[0] - u[1] * t[1] + v[0] * s[0] - v[1] * s[1]
                                            + c[0] * h[0] - c[1] * h[1]);
                            first[q + a] = -2 * (u[0] * t[1] + u[1] * t[0] + v[0] * s[1]
                                                 + v[1] * s[0] + c[0] * h[1] + c[1] * h[0]);
                            second[a] = 2 * (x * t[0] - y * t[1]);
                            second[q + a] = -2 * (x * t[1] + y * t[0]);
                        }
                }
    return 0;
}

/* Whether g.x + x.H.x/2 <= allowed for low <= x <= high is shown by a concave function above it:
   the quadratic plus s_i (x_i - low_i)(high_i - x_i)/2 (alpha-BB), and its tangents. */
static int stays_below(int d, const double *g, double H[MOST][MOST], const double *low,
                       const double *high, double allowed)
{
    double shift[MOST], slope[MOST], x[MOST], L[MOST][MOST], value = 0.0;
    for (int i = 0; i < d; i++) {
        double width = high[i] - low[i];
        shift[i] = 0.0;
        x[i] = low[i] > 0 ? low[i] : high[i] < 0 ? high[i] : 0.0;
        if (width > 0) {
            shift[i] = allowed / (d * width * width);
            if ((high[i] <= 0 && g[i] > 0) || (low[i] >= 0 && g[i] < 0))
                shift[i] += fabs(g[i]) / width;
        }
    }
    for (int i = 0; i < d; i++) { /* Cholesky of shift - H on the axes with a width */
        if (!(high[i] > low[i]))
            continue;
        for (int j = 0; j <= i; j++) {
            if (!(high[j] > low[j]))
                continue;
            double sum = (i == j ? shift[i] : 0.0) - H[i][j];
            for (int k = 0; k < j; k++)
                if (high[k] > low[k])
                    sum -= L[i][k] * L[j][k];
            if (i == j) {
                if (!(sum > 1e-12 * (shift[i] + fabs(H[i][i]))))
                    return 0;
                L[i][i] = sqrt(sum);
            } else
                L[i][j] = sum / L[j][j];
        }
    }
    for (int i = 0; i < d; i++) {
        double bent = 0.0;
        for (int j = 0; j < d; j++)
            bent += H[i][j] * x[j];
        value += (g[i] + 0.5 * bent) * x[i] + 0.5 * shift[i] * (x[i] - low[i]) * (high[i] - x[i]);
        slope[i] = g[i] + bent + 0.5 * shift[i] * (low[i] + high[i] - 2 * x[i]);
    }
    for (int sweep = 0; sweep < SWEEPS; sweep++) {
        double tangent = value;
        for (int i = 0; i < d; i++)
            if (high[i] > low[i]) {
                double up = slope[i] * (high[i] - x[i]), down = slope[i] * (low[i] - x[i]);
                tangent += up > down ? up : down;
            }
        if (tangent <= allowed)
            return 1;
        if (value > allowed)
            return 0;
        for (int i = 0; i < d; i++) {
            if (!(high[i] > low[i]))
                continue;
            double bend = shift[i] - H[i][i], next = x[i] + slope[i] / bend;
            next = next < low[i] ? low[i] : next > high[i] ? high[i] : next;
            double step = next - x[i];
            value += step * (slope[i] - 0.5 * bend * step);
            x[i] = next;
            for (int j = 0; j < d; j++)
                slope[j] += H[j][i] * step;
            slope[i] -= shift[i] * step;
        }
    }
    return 0;
}

/* Examine all items of some boxes; returns 0.

   G: per box, output and term of the waves the value, gradient and Hessian (upper triangle) that it
   carries, (boxes, m, terms, q); wave: (rows, terms). third: bounds of third derivatives
   (T, m, d, d, d); margin: for rounding of values and slopes, (T, m, 1 + d). edges: whether the lower
   and the upper face of a box lie on that of the domain, (boxes, 2, d). Of each problem, by node,
   output and side (lower first): value, point (d), and the jet of the output there (q). */
int examine(long boxes, int d, int m, int terms, int q, const long *row_start, const long *item_start,
            const long *row_node, const int *column, const double *G, const double *wave,
            const double *third, const double *margin, const double *centre, const double *radius,
            const unsigned char *edges, const double *best, const double *point, const double *jets,
            double gap, int *code, double *value)
{
    for (long box = 0; box < boxes; box++) {
        const double *c = centre + box * d, *r = radius + box * d;
        const unsigned char *edge = edges + 2 * box * d;
        for (long row = row_start[box]; row < row_start[box + 1]; row++) {
            long node = row_node[row];
            int done = -1;
            double J[1 + MOST + MOST * (MOST + 1) / 2], H[MOST][MOST], bent[MOST], cubic[MOST];
            double rest = 0.0, linear = 0.0;
            const double *T = 0;
            for (long item = item_start[row]; item < item_start[row + 1]; item++) {
                int output = column[item] / 2;
                double side = column[item] % 2 ? 1.0 : -1.0;
                long problem = node * 2 * m + column[item];
                if (output != done) {
                    const double *table = G + (box * m + output) * terms * q;
                    const double *w = wave + row * terms;
                    for (int a = 0; a < q; a++)
                        J[a] = 0.0;
                    for (int k = 0; k < terms; k++)
                        for (int a = 0; a < q; a++)
                            J[a] += w[k] * table[k * q + a];
                    int a = 1 + d;
                    for (int i = 0; i < d; i++)
                        for (int j = i; j < d; j++)
                            H[i][j] = H[j][i] = J[a++];
                    T = third + (node * m + output) * d * d * d;
                    const double *noise = margin + (node * m + output) * (1 + d);
                    rest = noise[0];
                    linear = 0.0;
                    for (int i = 0; i < d; i++) {
                        double sum = 0.0, spread = 0.0;
                        for (int j = 0; j < d; j++) {
                            double pair = 0.0;
                            for (int k = 0; k < d; k++)
                                pair += T[(i * d + j) * d + k] * r[k];
                            sum += pair * r[j];
                            spread += fabs(H[i][j]) * r[j];
                        }
                        rest += sum * r[i] / 6;
                        cubic[i] = 0.5 * sum + noise[1 + i];
                        bent[i] = spread;
                        linear += (fabs(J[1 + i]) + 0.5 * spread) * r[i];
                    }
                    done = output;
                }
                double f = side * J[0], target = best[problem] + gap;
                value[item] = f;
                code[item] = 0;
                if (f + linear + rest <= target)
                    continue;
                int faces = 0, closed = 0, place = 1;
                for (int i = 0; i < d && !closed; i++, place *= 3) {
                    if (!(r[i] > 0 && fabs(J[1 + i]) > bent[i] + cubic[i]))
                        continue;
                    int upper = side * J[1 + i] > 0;
                    if (edge[upper * d + i])
                        faces += place * (1 + upper);
                    else
                        closed = 1; /* the neighbour holds higher points */
                }
                if (closed)
                    continue;
                double top = f + rest;
                for (int i = 0; i < d; i++) {
                    if (!(r[i] > 0))
                        continue;
                    double h = side * H[i][i], bend = h + bent[i] / r[i] - fabs(H[i][i]);
                    double slope = fabs(J[1 + i]);
                    top += bend < 0 && slope < -bend * r[i] ? -slope * slope / (2 * bend)
                                                            : slope * r[i] + 0.5 * bend * r[i] * r[i];
                }
                if (top <= target)
                    continue;
                if (faces) {
                    code[item] = FACES + faces;
                    continue;
                }
                double g[MOST], S[MOST][MOST], low[MOST], high[MOST];
                double room = target - f - rest;
                if (room > 0) {
                    for (int i = 0; i < d; i++) {
                        g[i] = side * J[1 + i];
                        low[i] = -r[i];
                        high[i] = r[i];
                        for (int j = 0; j < d; j++)
                            S[i][j] = side * H[i][j];
                    }
                    if (stays_below(d, g, S, low, high, room))
                        continue;
                }
                const double *at = point + problem * d, *jet = jets + problem * q;
                double span[MOST];
                int near = 1, a = 1 + d;
                for (int i = 0; i < d; i++) {
                    low[i] = c[i] - r[i] - at[i];
                    high[i] = c[i] + r[i] - at[i];
                    double off = low[i] > 0 ? low[i] : high[i] < 0 ? -high[i] : 0.0;
                    near &= off <= NEAR * r[i] + 1e-12;
                    span[i] = fabs(low[i]) > fabs(high[i]) ? fabs(low[i]) : fabs(high[i]);
                    if (span[i] < 1e-9)
                        span[i] = 1e-9;
                }
                if (near) {
                    for (int i = 0; i < d; i++) {
                        double sum = 0.0;
                        for (int j = 0; j < d; j++)
                            for (int k = 0; k < d; k++)
                                sum += T[(i * d + j) * d + k] * span[j] * span[k];
                        for (int j = i; j < d; j++)
                            S[i][j] = S[j][i] = side * jet[a++];
                        /* the cubic remainder is at most sum of bend_i x_i^2 / 6 */
                        S[i][i] += sum / span[i] / 3;
                        g[i] = side * jet[1 + i];
                    }
                    double excess = side * jet[0] - best[problem];
                    double allowed = gap - margin[(node * m + output) * (1 + d)] - excess;
                    if (allowed > 0 && stays_below(d, g, S, low, high, allowed))
                        continue;
                }
                int axis = 0;
                double most = -1.0;
                for (int i = 0; i < d; i++) {
                    double weight = r[i] * (2 * cubic[i] + 0.5 * bent[i]);
                    if (r[i] > 0 && weight > most) {
                        most = weight;
                        axis = i;
                    }
                }
                code[item] = 1 + axis;
            }
        }
    }
    return 0;
}
