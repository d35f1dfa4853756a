/* Modes of lambda^2 M + lambda D + K with symmetric M, D, K, and outputs at single nodes with what
   each entry of M, D, K, of the start and of the row does to them: the twin of exact_response.py. */
#include <complex.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

typedef double complex z;

/* Lower Cholesky factor of A (n, n) in place; 0 where A is not positive definite. */
static int cholesky(int n, double *A)
{
    for (int j = 0; j < n; j++) {
        for (int i = j; i < n; i++) {
            double s = A[i * n + j];
            for (int k = 0; k < j; k++) s -= A[i * n + k] * A[j * n + k];
            if (i == j) {
                if (!(s > 0)) return 0;
                A[j * n + j] = sqrt(s);
            } else A[i * n + j] = s / A[j * n + j];
        }
    }
    return 1;
}

/* B := Wt A W with W (n, n); `work` holds n * n numbers. */
static void congruent(int n, const double *restrict A, const double *restrict W,
                      double *restrict B, double *restrict work)
{
    for (int i = 0; i < n * n; i++) B[i] = work[i] = 0;
    for (int i = 0; i < n; i++)
        for (int k = 0; k < n; k++)
            for (int j = 0; j < n; j++) work[i * n + j] += A[i * n + k] * W[k * n + j];
    for (int k = 0; k < n; k++)
        for (int i = 0; i < n; i++)
            for (int j = 0; j < n; j++) B[i * n + j] += W[k * n + i] * work[k * n + j];
}

/* W := L^-T V with L lower. */
static void lifted(int n, const double *restrict L, const double *restrict V, double *restrict W)
{
    for (int i = n - 1; i >= 0; i--) {
        for (int j = 0; j < n; j++) W[i * n + j] = V[i * n + j];
        for (int k = i + 1; k < n; k++)
            for (int j = 0; j < n; j++) W[i * n + j] -= L[k * n + i] * W[k * n + j];
        double one = 1 / L[i * n + i];
        for (int j = 0; j < n; j++) W[i * n + j] *= one;
    }
}

/* Jacobi's rotations: W := W V with Vt A V diagonal; A becomes it. 0 where they do not end. */
static int diagonal(int n, double *A, double *W)
{
    for (int sweep = 0; sweep < 40; sweep++) {
        int turned = 0;
        for (int p = 0; p < n; p++)
            for (int q = p + 1; q < n; q++) {
                double off = A[p * n + q], a = A[p * n + p], b = A[q * n + q];
                if (fabs(off) <= 1e-16 * sqrt(fabs(a * b)) || fabs(off) < 1e-290) continue;
                turned = 1;
                double h = (b - a) / (2 * off);
                double t = (h >= 0 ? 1 : -1) / (fabs(h) + sqrt(1 + h * h));
                double c = 1 / sqrt(1 + t * t), s = t * c;
                for (int k = 0; k < n; k++) {
                    double x = A[p * n + k], y = A[q * n + k];
                    A[p * n + k] = c * x - s * y;
                    A[q * n + k] = s * x + c * y;
                }
                for (int k = 0; k < n; k++) {
                    double x = A[k * n + p], y = A[k * n + q];
                    A[k * n + p] = c * x - s * y;
                    A[k * n + q] = s * x + c * y;
                    x = W[k * n + p], y = W[k * n + q];
                    W[k * n + p] = c * x - s * y;
                    W[k * n + q] = s * x + c * y;
                }
                A[p * n + q] = A[q * n + p] = 0;
            }
        if (!turned) return 1;
    }
    return 0;
}

/* Plain formulas: what they are of is neither huge nor tiny. */
static double length(z x) { return sqrt(creal(x) * creal(x) + cimag(x) * cimag(x)); }

static z root(z x)
{
    double most = sqrt((length(x) + fabs(creal(x))) / 2), other = most > 0 ? fabs(cimag(x)) / (2 * most) : 0;
    return creal(x) >= 0 ? most + I * copysign(other, cimag(x)) : other + I * copysign(most, cimag(x));
}

static double size(z x) { return fabs(creal(x)) + fabs(cimag(x)); }

/* x := B^-1 x by elimination with pivots, none below `least`; B (n, n) is lost. */
static void solved(int n, z *B, z *x, double least)
{
    for (int j = 0; j < n; j++) {
        int best = j;
        for (int i = j + 1; i < n; i++)
            if (size(B[i * n + j]) > size(B[best * n + j])) best = i;
        if (best != j) {
            for (int k = j; k < n; k++) {
                z t = B[j * n + k];
                B[j * n + k] = B[best * n + k];
                B[best * n + k] = t;
            }
            z t = x[j];
            x[j] = x[best];
            x[best] = t;
        }
        if (size(B[j * n + j]) < least) B[j * n + j] = least;
        z one = 1 / B[j * n + j];
        for (int i = j + 1; i < n; i++) {
            z f = B[i * n + j] * one;
            if (f == 0) continue;
            for (int k = j + 1; k < n; k++) B[i * n + k] -= f * B[j * n + k];
            x[i] -= f * x[j];
        }
        B[j * n + j] = one;
    }
    for (int j = n - 1; j >= 0; j--) {
        for (int k = j + 1; k < n; k++) x[j] -= B[j * n + k] * x[k];
        x[j] *= B[j * n + j];
    }
}

static double largest(int n, const z *u)
{
    double most = 0;
    for (int j = 0; j < n; j++) most = size(u[j]) > most ? size(u[j]) : most;
    return most;
}

/* Root of ut (l^2 + l C + mu) u = 0 next to `near`. */
static z rayleigh(int n, const double *C, const double *mu, const z *u, z near)
{
    z a = 0, c = 0, m = 0;
    for (int i = 0; i < n; i++) {
        z s = 0;
        for (int j = 0; j < n; j++) s += C[i * n + j] * u[j];
        a += u[i] * u[i];
        c += u[i] * s;
        m += mu[i] * u[i] * u[i];
    }
    z turn = root(c * c - 4 * a * m), one = (-c + turn) / (2 * a), two = (-c - turn) / (2 * a);
    return length(one - near) < length(two - near) ? one : two;
}

/* Iterates a mode whose shape hardly leaves the k-th undamped one, u_k = 1; 0 where that fails.
   What is left of each row is divided by its own entry at the first rate. */
static int weakly_coupled(int n, int k, const double *C, const double *mu, z *rate, z *u, z *work)
{
    double *re = (double *)work, *im = re + n;
    z *over = work + n, l = *rate;
    for (int j = 0; j < n; j++) over[j] = j == k ? 0 : 1 / (l * l + l * C[j * n + j] + mu[j]);
    for (int turns = 0; turns < 15; turns++) {
        double moved = 0;
        for (int j = 0; j < n; j++) re[j] = im[j] = 0;
        for (int i = 0; i < n; i++) {  /* C u: C is symmetric */
            double a = creal(u[i]), b = cimag(u[i]);
            for (int j = 0; j < n; j++) re[j] += C[i * n + j] * a;
            for (int j = 0; j < n; j++) im[j] += C[i * n + j] * b;
        }
        z half = (re[k] + I * im[k]) / 2, turn = root(half * half - mu[k]);
        *rate = cimag(turn) < 0 ? -half - turn : -half + turn;
        for (int j = 0; j < n; j++) {
            z step = ((l * l + mu[j]) * u[j] + l * (re[j] + I * im[j])) * over[j];
            moved = fmax(moved, size(step));
            u[j] -= step;
        }
        moved = fmax(moved, size(*rate - l) / size(l));
        l = *rate;
        if (!(moved < 1e-2)) return 0;
        if (moved < 1e-15) return cimag(l) > 1e-9 * length(l);
    }
    return 0;
}

/* The mode of l^2 + l C + mu that grows out of the k-th undamped one; 0 where it is not found. */
static int mode(int n, int k, const double *C, const double *mu, z *rate, z *u, z *work)
{
    double decay = C[k * n + k] / 2, turn = mu[k] - decay * decay;
    if (!(turn > 0)) return 0;
    z l = -decay + I * sqrt(turn);
    for (int j = 0; j < n; j++) {
        z own = l * l + l * C[j * n + j] + mu[j];
        u[j] = j == k ? 1 : -l * C[j * n + k] / own;
        if (j != k && !(size(u[j]) < 1)) u[j] = 0;
    }
    z *kept = work + 2 * n;
    *rate = l;
    memcpy(kept, u, n * sizeof(z));
    if (weakly_coupled(n, k, C, mu, rate, u, work)) return 1;
    memcpy(u, kept, n * sizeof(z));
    l = rayleigh(n, C, mu, u, l);
    for (int turns = 0; turns < 12; turns++) {
        z *B = work, *w = work + n * n, before = l;
        for (int i = 0; i < n; i++) {
            w[i] = 2 * l * u[i];
            for (int j = 0; j < n; j++) {
                B[i * n + j] = l * C[i * n + j] + (i == j ? l * l + mu[i] : 0);
                w[i] += C[i * n + j] * u[j];
            }
        }
        solved(n, B, w, 1e-17 * length(l) * length(l));
        double most = largest(n, w);
        if (!(most > 0) || !isfinite(most)) return 0;
        for (int i = 0; i < n; i++) u[i] = w[i] * (1 / most);
        l = rayleigh(n, C, mu, u, l);
        if (!isfinite(creal(l)) || !isfinite(cimag(l))) return 0;
        if (length(l - before) < 1e-12 * length(l)) {
            *rate = l;
            return cimag(l) > 1e-9 * length(l);
        }
    }
    return 0;
}

/* Whether the scaled modes are different ones, and all: Y X = 1 to 1e-9; work (n, n). */
static int complete(int n, const double *C, const z *rate, const z *u, z *work)
{
    for (int k = 0; k < n; k++)
        for (int b = 0; b < n; b++) {
            z own = u[k * n + b];
            for (int a = 0; a < n; a++) work[k * n + a] = (b ? work[k * n + a] : 0) + C[b * n + a] * own;
        }
    for (int j = 0; j < n; j++)
        for (int k = 0; k <= j; k++) {
            z both = 0, cross = 0, damped = 0, other = 0;
            for (int a = 0; a < n; a++) {
                z own = u[j * n + a];
                both += own * u[k * n + a];
                damped += own * work[k * n + a];
                cross += own * conj(u[k * n + a]);
                other += own * conj(work[k * n + a]);
            }
            if (j != k && !(size((rate[j] + rate[k]) * both + damped) < 1e-9)) return 0;
            if (!(size((rate[j] + conj(rate[k])) * cross + other) < 1e-9)) return 0;
        }
    return 1;
}

/* Modes by rising |lambda| at `points` sets, M, D, K (points, n, n): rate (points, n), right vectors
   (points, n modes, n), left ones (points, n modes, 2n) with Y [x; lambda x] = 1.
   Returns 0 where a set's are not found: not oscillating, nearly equal or nearly critical. */
int damped_modes(long points, int n, const double *M, const double *D, const double *K,
                 double *rates, double *right, double *left)
{
    long nn = (long)n * n;
    double *real = calloc(6 * nn + n, sizeof(double)), *L = real, *W = real + nn, *A = W + nn;
    double *C = A + nn, *work = C + nn, *mu = work + nn, *V = mu + n;
    z *both = calloc(3 * nn + 5 * n, sizeof(z)), *u = both, *rest = u + nn, *l = rest + nn + 3 * n;
    int *order = calloc(n, sizeof(int)), good = real && both && order;
    for (long p = 0; p < points && good; p++) {
        const double *Mp = M + p * nn, *Dp = D + p * nn, *Kp = K + p * nn;
        if (p % 16 == 0)  /* before round-off adds up */
            for (int i = 0; i < nn; i++) V[i] = i % (n + 1) == 0;
        memcpy(L, Mp, nn * sizeof(double));
        if (!(good = cholesky(n, L))) break;
        lifted(n, L, V, W);  /* the basis of the last set first */
        congruent(n, Kp, W, A, work);
        if (!(good = diagonal(n, A, V))) break;
        lifted(n, L, V, W);
        congruent(n, Dp, W, C, work);
        for (int k = 0; k < n; k++) mu[k] = A[k * n + k];
        for (int k = 0; k < n && good; k++) {
            z *own = u + k * n, scale = 0;
            if (!(good = mode(n, k, C, mu, l + k, own, rest))) break;
            double sum = 0;
            for (int i = 0; i < n; i++) {
                z s = 2 * l[k] * own[i];
                for (int j = 0; j < n; j++) s += C[i * n + j] * own[j];
                scale += own[i] * s;
                sum += creal(own[i] * conj(own[i]));
            }
            if (!(good = length(scale) > 1e-6 * length(l[k]) * sum)) break;
            scale = 1 / root(scale);
            for (int i = 0; i < n; i++) own[i] *= scale;
        }
        if (!good || !(good = complete(n, C, l, u, rest))) break;
        for (int k = 0; k < n; k++) {
            int place = k;
            for (; place > 0 && length(l[order[place - 1]]) > length(l[k]); place--)
                order[place] = order[place - 1];
            order[place] = k;
        }
        for (int k = 0; k < n; k++) {
            z *x = (z *)right + (p * n + k) * n, *y = (z *)left + (p * n + k) * 2 * n;
            const z *own = u + order[k] * n, rate = ((z *)rates)[p * n + k] = l[order[k]];
            for (int i = 0; i < n; i++) {
                x[i] = 0;
                for (int j = 0; j < n; j++) x[i] += W[i * n + j] * own[j];
            }
            for (int i = 0; i < n; i++) {
                z mass = 0, damping = 0;
                for (int j = 0; j < n; j++) {
                    mass += Mp[i * n + j] * x[j];
                    damping += Dp[i * n + j] * x[j];
                }
                y[i] = rate * mass + damping;
                y[n + i] = mass;
            }
        }
    }
    free(real);
    free(both);
    free(order);
    return good;
}

static z divided(z gap, int near, z f, z g, z df, z dg) { return near ? (df + dg) / 2 : (f - g) / gap; }

/* Outputs of `problems` at one set and node each: f (problems), and for `deep` what entries of M, D
   and K do to them (problems, 3, n, n), the start (problems, 2n) and the row (problems, 2n).
   own: their sets; state (sets, 2n); row (problems, 2n); answer and slope (problems, n) to the
   ground where `shaken`; near: phase below which a divided difference is a derivative. */
int damped_outputs(long problems, int n, int deep, int shaken, double near, const double *own,
                   const double *time, const double *rates, const double *right,
                   const double *left, const double *state, const double *rigid,
                   const double *row, const double *answers, const double *slopes, double *f,
                   double *by, double *back, double *seen)
{
    z *all = calloc(13 * n + 3 * (long)n * n, sizeof(z)), *wave = all, *start = wave + n;
    z *push = start + n, *l = push + n, *P = l + n;
    if (!all) return 0;
    for (long p = 0; p < problems; p++) {
        long s = (long)own[p];
        double t = time[p];
        const z *rate = (const z *)rates + s * n, *X = (const z *)right + s * n * n;
        const z *Y = (const z *)left + 2 * s * n * n;
        const z *R = (const z *)answers + p * n, *dR = (const z *)slopes + p * n;
        const double *r = row + 2 * p * n, *x0 = state + 2 * s * n;
        double *b = back + 2 * p * n, *e = seen + 2 * p * n, *G = by + 3 * p * n * n;
        f[p] = 0;
        if (deep) memset(b, 0, 2 * n * sizeof(double)), memset(e, 0, 2 * n * sizeof(double));
        for (int k = 0; k < n; k++) {
            const z *x = X + k * n, *y = Y + 2 * k * n;
            double fall = exp(creal(rate[k]) * t), turn = cimag(rate[k]) * t;
            z q = 0, v = 0;
            wave[k] = fall * cos(turn) + I * (fall * sin(turn));
            start[k] = push[k] = 0;
            for (int i = 0; i < n; i++) {
                q += r[i] * x[i];
                v += r[n + i] * x[i];
                start[k] += x0[i] * y[i] + x0[n + i] * y[n + i];
                push[k] -= rigid[i] * y[n + i];
            }
            l[k] = q + rate[k] * v;
            z motion = wave[k] * start[k] + (shaken ? R[k] * push[k] : 0);
            f[p] += 2 * creal(l[k] * motion);
            if (!deep) continue;
            z out = l[k] * wave[k], fast = rate[k] * motion;
            for (int i = 0; i < 2 * n; i++) b[i] += 2 * creal(out * y[i]);
            for (int i = 0; i < n; i++) {
                e[i] += 2 * creal(x[i] * motion);
                e[n + i] += 2 * creal(x[i] * fast);
            }
        }
        if (!deep) continue;
        memset(P, 0, 3 * n * n * sizeof(z));
        for (int j = 0; j < n; j++)
            for (int k = 0; k < n; k++) {
                z gap = rate[j] - rate[k], across = rate[j] - conj(rate[k]);
                int close = length(gap) * t < near, beside = length(across) * t < near;
                z w = start[k] * divided(gap, close, wave[j], wave[k], t * wave[j], t * wave[k]);
                z c = conj(start[k]) * divided(across, beside, wave[j], conj(wave[k]), t * wave[j],
                                               t * conj(wave[k]));
                if (shaken) {
                    w += push[k] * divided(gap, close, R[j], R[k], dR[j], dR[k]);
                    c += conj(push[k]) * divided(across, beside, R[j], conj(R[k]), dR[j],
                                                 conj(dR[k]));
                }
                w *= l[j];
                c *= l[j];
                z w1 = w * rate[k], c1 = c * conj(rate[k]);
                z w2 = w1 * rate[k], c2 = c1 * conj(rate[k]);
                for (int i = 0; i < n; i++) {  /* of D, K by rate, then M by its square */
                    z x = X[k * n + i], d = conj(x);
                    P[(n + j) * n + i] += w1 * x + c1 * d;
                    P[(2 * n + j) * n + i] += w * x + c * d;
                    P[j * n + i] += w2 * x + c2 * d;
                }
            }
        for (int part = 0; part < 3; part++)
            for (int i = 0; i < n; i++)
                for (int m = 0; m < n; m++) {
                    double sum = 0;
                    for (int j = 0; j < n; j++)
                        sum += creal(X[j * n + i] * P[(part * n + j) * n + m]);
                    G[(part * n + i) * n + m] = -2 * sum;
                }
    }
    free(all);
    return 1;
}
