/* Maxima of quadratics g.x + x.H.x/2 over boxes: the twin of box_quadratic.py. */
#include <math.h>
#include <string.h>

#define MOST 64
#define FACES 6

/* g + H x for a symmetric H. */
static void slopes(int d, const double *g, const double *H, const double *x, double *s)
{
    memcpy(s, g, d * sizeof(double));
    for (int j = 0; j < d; j++)
        if (x[j] != 0)
            for (int i = 0; i < d; i++) s[i] += H[j * d + i] * x[j];
}

static double gain(int d, const double *g, const double *H, const double *x)
{
    double total = 0, s[MOST];
    slopes(d, g, H, x, s);
    for (int i = 0; i < d; i++) total += 0.5 * (g[i] + s[i]) * x[i];
    return total;
}

static double largest(long count, const double *H)
{
    double most[8] = {0}, found = 0;
    long k = 0;
    for (; k + 8 <= count; k += 8)
        for (int l = 0; l < 8; l++) most[l] = fabs(H[k + l]) > most[l] ? fabs(H[k + l]) : most[l];
    for (; k < count; k++) most[0] = fabs(H[k]) > most[0] ? fabs(H[k]) : most[0];
    for (int l = 0; l < 8; l++) found = most[l] > found ? most[l] : found;
    return found;
}

static void axes_ascent(int d, const double *g, const double *H, const double *low,
                        const double *high, double *x)
{
    double s[MOST];
    slopes(d, g, H, x, s);
    for (int i = 0; i < d; i++) {
        double c = H[i * d + i], level = s[i] - c * x[i], new;
        if (c < 0) {
            new = -level / c;
            new = new < low[i] ? low[i] : new > high[i] ? high[i] : new;
        } else
            new = level * (high[i] - low[i]) + 0.5 * c * (high[i] * high[i] - low[i] * low[i]) > 0
                      ? high[i] : low[i];
        if (new != x[i]) {
            for (int j = 0; j < d; j++) s[j] += H[i * d + j] * (new - x[i]);
            x[i] = new;
        }
    }
}

/* Gaussian elimination with partial pivoting of A y = b; 0 where A is singular. */
static int solved(int m, double *A, double *b)
{
    for (int k = 0; k < m; k++) {
        int p = k;
        for (int i = k + 1; i < m; i++)
            if (fabs(A[i * m + k]) > fabs(A[p * m + k])) p = i;
        if (A[p * m + k] == 0) return 0;
        if (p != k) {
            double t = b[k]; b[k] = b[p]; b[p] = t;
            for (int j = k; j < m; j++) {
                t = A[k * m + j]; A[k * m + j] = A[p * m + j]; A[p * m + j] = t;
            }
        }
        for (int i = k + 1; i < m; i++) {
            double f = A[i * m + k] / A[k * m + k];
            if (f == 0) continue;
            for (int j = k; j < m; j++) A[i * m + j] -= f * A[k * m + j];
            b[i] -= f * b[k];
        }
    }
    for (int i = m - 1; i >= 0; i--) {
        for (int j = i + 1; j < m; j++) b[i] -= A[i * m + j] * b[j];
        b[i] /= A[i * m + i];
    }
    return 1;
}

/* Projected Newton step on the free axes, halved at most twice. */
static void newton(int d, const double *g, const double *H, const double *low,
                   const double *high, double *x, double shift)
{
    double s[MOST], A[MOST * MOST], step[MOST], trial[MOST], best[MOST], top;
    int free[MOST], m = 0;
    slopes(d, g, H, x, s);
    for (int i = 0; i < d; i++)
        if (!((x[i] <= low[i] && s[i] <= 0) || (x[i] >= high[i] && s[i] >= 0))) free[m++] = i;
    for (int a = 0; a < m; a++) step[a] = -s[free[a]];
    for (int a = 0; a < m; a++)
        for (int b = 0; b < m; b++)
            A[a * m + b] = H[free[a] * d + free[b]] - (a == b ? shift : 0);
    if (!m || !solved(m, A, step)) return;
    top = gain(d, g, H, x);
    memcpy(best, x, d * sizeof(double));
    for (double length = 1; length >= 0.25; length /= 2) {
        memcpy(trial, x, d * sizeof(double));
        for (int a = 0; a < m; a++) {
            int i = free[a];
            double t = x[i] + length * step[a];
            trial[i] = t < low[i] ? low[i] : t > high[i] ? high[i] : t;
        }
        double value = gain(d, g, H, trial);
        if (value > top) {
            top = value;
            memcpy(best, trial, d * sizeof(double));
        }
    }
    memcpy(x, best, d * sizeof(double));
}

int local_maximum(long count, int d, int rounds, const double *g, const double *H,
                  const double *lower, const double *upper, double *x)
{
    if (d > MOST) return 0;
    for (long n = 0; n < count; n++) {
        const double *gn = g + n * d, *Hn = H + n * d * d;
        const double *low = lower + n * d, *high = upper + n * d;
        double *xn = x + n * d, shift = 1e-13 * largest(d * d, Hn), before = gain(d, gn, Hn, xn);
        for (int r = 0; r < rounds; r++) {
            axes_ascent(d, gn, Hn, low, high, xn);
            newton(d, gn, Hn, low, high, xn, shift);
            newton(d, gn, Hn, low, high, xn, shift);
            double after = gain(d, gn, Hn, xn);
            if (!(after - before > 1e-10 * (1e-6 + fabs(before)))) break;
            before = after;
        }
    }
    return 1;
}

/* Cholesky factor of A (m, m) in its place; 0 where it is not positive definite. */
static int definite(int m, double *A)
{
    for (int j = 0; j < m; j++)
        for (int i = j; i < m; i++) {
            double left = A[i * m + j];
            for (int k = 0; k < j; k++) left -= A[i * m + k] * A[j * m + k];
            if (i == j && !(left > 0)) return 0;
            A[i * m + j] = i == j ? sqrt(left) : left / A[j * m + j];
        }
    return 1;
}

static void solve(int m, const double *L, double *b)
{
    for (int i = 0; i < m; i++) {
        for (int j = 0; j < i; j++) b[i] -= L[i * m + j] * b[j];
        b[i] /= L[i * m + i];
    }
    for (int i = m - 1; i >= 0; i--) {
        for (int j = i + 1; j < m; j++) b[i] -= L[j * m + i] * b[j];
        b[i] /= L[i * m + i];
    }
}

/* Best maximum inside the faces on which the m axes `free` are not at their ends. */
static void faces(int d, int m, const int *free, const double *g, const double *H,
                  const double *low, const double *high, double *best, double *top)
{
    double A[FACES * FACES], step[FACES], x[FACES], largest = 0;
    int bound[FACES], b = 0;
    for (int i = 0; i < m * m; i++) {
        A[i] = -H[free[i / m] * d + free[i % m]];
        if (fabs(A[i]) > largest) largest = fabs(A[i]);
    }
    for (int i = 0; i < m; i++) A[i * m + i] += 1e-13 * (largest + 1e-300);
    if (!definite(m, A)) return; /* its faces hold better points */
    for (int i = 0, a = 0; i < d; i++)
        if (a < m && free[a] == i) a++; else bound[b++] = i;
    for (int c = 0; c < 1 << b; c++) {
        for (int k = 0; k < b; k++)
            x[bound[k]] = c >> (b - 1 - k) & 1 ? high[bound[k]] : low[bound[k]];
        for (int a = 0; a < m; a++) {
            step[a] = g[free[a]];
            for (int k = 0; k < b; k++) step[a] += H[free[a] * d + bound[k]] * x[bound[k]];
        }
        solve(m, A, step);
        for (int a = 0; a < m; a++) {
            int i = free[a];
            x[i] = step[a] < low[i] ? low[i] : step[a] > high[i] ? high[i] : step[a];
        }
        double value = gain(d, g, H, x);
        if (value > *top) {
            *top = value;
            memcpy(best, x, d * sizeof(double));
        }
    }
}

/* x, zero at first, becomes the global maximum; 0 where the faces are too many. */
int global_maximum(long count, int d, const double *g, const double *H, const double *lower,
                   const double *upper, double *x)
{
    if (d > FACES) return 0;
    for (long n = 0; n < count; n++) {
        double top = 0;
        for (int m = 0; m <= d; m++) {
            int free[FACES], k = 0;
            for (int i = 0; i < m; i++) free[i] = i;
            while (k >= 0) {
                faces(d, m, free, g + n * d, H + n * d * d, lower + n * d, upper + n * d,
                      x + n * d, &top);
                for (k = m - 1; k >= 0 && free[k] == d - m + k; k--) ;
                if (k >= 0) free[k]++;
                for (int i = k + 1; k >= 0 && i < m; i++) free[i] = free[i - 1] + 1;
            }
        }
    }
    return 1;
}
