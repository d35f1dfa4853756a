/* Modes of lambda^2 M + lambda D + K with symmetric M, D, K, and outputs at single nodes with what
   each entry of M, D, K, of the start and of the row does to them: the twin of exact_response.py. */
#include <complex.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

typedef double complex z;

/* Eight sets side by side, one in each lane. */
#define LANES 8
typedef double v __attribute__((vector_size(8 * LANES)));
typedef long long flags __attribute__((vector_size(8 * LANES)));
typedef struct { v re, im; } c;

static v pick(flags which, v yes, v no) { return (v)(((flags)yes & which) | ((flags)no & ~which)); }
static v magnitude(v x) { return pick(x < 0, -x, x); }
static v larger(v x, v y) { return pick(x > y, x, y); }

static v roots(v x)
{
    union { v all; double each[LANES]; } r = {x};
    for (int i = 0; i < LANES; i++) r.each[i] = sqrt(r.each[i]);
    return r.all;
}

static int any(flags which)
{
    long long found = 0;
    for (int i = 0; i < LANES; i++) found |= which[i];
    return found != 0;
}

static c both(v re, v im) { c x = {re, im}; return x; }
static c sum(c x, c y) { return both(x.re + y.re, x.im + y.im); }
static c product(c x, c y) { return both(x.re * y.re - x.im * y.im, x.re * y.im + x.im * y.re); }
static c times(v f, c x) { return both(f * x.re, f * x.im); }
static c choice(flags which, c x, c y) { return both(pick(which, x.re, y.re), pick(which, x.im, y.im)); }
static v size(c x) { return magnitude(x.re) + magnitude(x.im); }
static v length(c x) { return roots(x.re * x.re + x.im * x.im); }
static c inverse(c x) { v f = 1 / (x.re * x.re + x.im * x.im); return both(f * x.re, -f * x.im); }

/* Square root with a real part that is not negative; plain: x is neither huge nor tiny. */
static c complex_root(c x)
{
    v most = roots((length(x) + magnitude(x.re)) / 2);
    v other = pick(most > 0, magnitude(x.im) / (2 * most), most), turned = pick(x.im < 0, -most, most);
    return choice(x.re >= 0, both(most, pick(x.im < 0, -other, other)), both(other, turned));
}

/* Lower Cholesky factor of A (n, n) in place; 0 where one is not positive definite. */
static int cholesky(int n, v *A)
{
    for (int j = 0; j < n; j++) {
        v one = {0};
        for (int i = j; i < n; i++) {
            v s = A[i * n + j];
            for (int k = 0; k < j; k++) s -= A[i * n + k] * A[j * n + k];
            if (i == j) {
                if (any(~(s > 0))) return 0;
                A[j * n + j] = roots(s);
                one = 1 / A[j * n + j];
            } else A[i * n + j] = s * one;
        }
    }
    return 1;
}

/* B := Wt A W with W (n, n) and symmetric A; `work` holds n * n lanes. */
static void congruent(int n, const v *restrict A, const v *restrict W, v *restrict B, v *restrict work)
{
    for (int i = 0; i < n; i++)
        for (int j = 0; j < n; j++) {
            v s = {0};
            for (int k = 0; k < n; k++) s += A[i * n + k] * W[k * n + j];
            work[i * n + j] = s;
        }
    for (int i = 0; i < n; i++)
        for (int j = 0; j <= i; j++) {
            v s = {0};
            for (int k = 0; k < n; k++) s += W[k * n + i] * work[k * n + j];
            B[i * n + j] = B[j * n + i] = s;
        }
}

/* W := L^-T V with L lower. */
static void lifted(int n, const v *restrict L, const v *restrict V, v *restrict W)
{
    for (int i = n - 1; i >= 0; i--) {
        v one = 1 / L[i * n + i];
        for (int j = 0; j < n; j++) {
            v s = V[i * n + j];
            for (int k = i + 1; k < n; k++) s -= L[k * n + i] * W[k * n + j];
            W[i * n + j] = s * one;
        }
    }
}

/* x, y := c x - s y, s x + c y. */
static void turn(v c, v s, v *x, v *y)
{
    v before = *x;
    *x = c * before - s * *y;
    *y = s * before + c * *y;
}

/* Jacobi's rotations: V := V R with Rt A R diagonal; A becomes it. 0 where they do not end. */
static int diagonal(int n, v *A, v *V)
{
    for (int sweep = 0; sweep < 40; sweep++) {
        int turned = 0;
        for (int p = 0; p < n; p++)
            for (int q = p + 1; q < n; q++) {
                v off = A[p * n + q], a = A[p * n + p], b = A[q * n + q], far = magnitude(off);
                flags open = (far > 1e-16 * roots(magnitude(a * b))) & (far >= 1e-290);
                if (!any(open)) continue;
                turned = 1;
                v h = pick(open, (b - a) / (2 * off), off), steep = 1 / (magnitude(h) + roots(1 + h * h));
                v t = pick(open, pick(h < 0, -steep, steep), off * 0);
                v cosine = 1 / roots(1 + t * t), sine = t * cosine;
                for (int k = 0; k < n; k++) {
                    turn(cosine, sine, V + k * n + p, V + k * n + q);
                    if (k == p || k == q) continue;
                    turn(cosine, sine, A + k * n + p, A + k * n + q);
                    A[p * n + k] = A[k * n + p];
                    A[q * n + k] = A[k * n + q];
                }
                A[p * n + p] = a - t * off;
                A[q * n + q] = b + t * off;
                A[p * n + q] = A[q * n + p] = pick(open, off * 0, off);
            }
        if (!turned) return 1;
    }
    return 0;
}

/* Plain formulas: what they are of is neither huge nor tiny. */
static double modulus(z x) { return sqrt(creal(x) * creal(x) + cimag(x) * cimag(x)); }

static z root(z x)
{
    double most = sqrt((modulus(x) + fabs(creal(x))) / 2), other = most > 0 ? fabs(cimag(x)) / (2 * most) : 0;
    return creal(x) >= 0 ? most + I * copysign(other, cimag(x)) : other + I * copysign(most, cimag(x));
}

static double span(z x) { return fabs(creal(x)) + fabs(cimag(x)); }

/* x := B^-1 x by elimination with pivots, none below `least`; B (n, n) is lost. */
static void solved(int n, z *B, z *x, double least)
{
    for (int j = 0; j < n; j++) {
        int best = j;
        for (int i = j + 1; i < n; i++)
            if (span(B[i * n + j]) > span(B[best * n + j])) best = i;
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
        if (span(B[j * n + j]) < least) B[j * n + j] = least;
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
    for (int j = 0; j < n; j++) most = span(u[j]) > most ? span(u[j]) : most;
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
    return modulus(one - near) < modulus(two - near) ? one : two;
}

/* The mode of l^2 + l C + mu that grows out of u at l, by inverse iteration; 0 where none is found. */
static int strongly_coupled(int n, const double *C, const double *mu, z *rate, z *u, z *work)
{
    z l = rayleigh(n, C, mu, u, *rate);
    for (int turns = 0; turns < 12; turns++) {
        z *B = work, *w = work + n * n, before = l;
        for (int i = 0; i < n; i++) {
            w[i] = 2 * l * u[i];
            for (int j = 0; j < n; j++) {
                B[i * n + j] = l * C[i * n + j] + (i == j ? l * l + mu[i] : 0);
                w[i] += C[i * n + j] * u[j];
            }
        }
        solved(n, B, w, 1e-17 * modulus(l) * modulus(l));
        double most = largest(n, w);
        if (!(most > 0) || !isfinite(most)) return 0;
        for (int i = 0; i < n; i++) u[i] = w[i] * (1 / most);
        l = rayleigh(n, C, mu, u, l);
        if (!isfinite(creal(l)) || !isfinite(cimag(l))) return 0;
        if (modulus(l - before) < 1e-12 * modulus(l)) {
            *rate = l;
            return cimag(l) > 1e-9 * modulus(l);
        }
    }
    return 0;
}

/* Iterates modes whose shapes hardly leave the k-th undamped one, u_k = 1; returns where that ends.
   What is left of each row is divided by its own entry at the first rate. work: 2 n. */
static flags weakly_coupled(int n, int k, const v *C, const v *mu, c *rate, c *u, c *work)
{
    c *over = work, *Cu = work + n, l = *rate, square = product(l, l);
    flags open = mu[k] == mu[k], done = ~open;
    for (int j = 0; j < n; j++)
        over[j] = inverse(both(square.re + l.re * C[j * n + j] + mu[j], square.im + l.im * C[j * n + j]));
    over[k] = times(0 * mu[k], l);
    for (int turns = 0; turns < 15 && any(open); turns++) {
        for (int j = 0; j < n; j++) {
            c s = times(C[j * n], u[0]);
            for (int i = 1; i < n; i++) s = sum(s, times(C[j * n + i], u[i]));
            Cu[j] = s;
        }
        c half = times(mu[k] * 0 + 0.5, Cu[k]), inner = product(half, half), next;
        inner.re -= mu[k];
        next = complex_root(inner);
        v sign = pick(next.im < 0, mu[k] * 0 - 1, mu[k] * 0 + 1), moved = {0};
        next = both(sign * next.re - half.re, sign * next.im - half.im);
        square = product(l, l);
        for (int j = 0; j < n; j++) {
            c own = both(square.re + mu[j], square.im);
            c step = product(sum(product(own, u[j]), product(l, Cu[j])), over[j]);
            moved = larger(moved, size(step));
            u[j] = choice(open, both(u[j].re - step.re, u[j].im - step.im), u[j]);
        }
        moved = larger(moved, size(both(next.re - l.re, next.im - l.im)) / size(l));
        l = choice(open, next, l);
        done |= open & (moved < 1e-15) & (l.im > 1e-9 * length(l));
        open &= (moved < 1e-2) & ~(moved < 1e-15);
    }
    *rate = l;
    return done;
}

/* The modes of l^2 + l C + mu that grow out of the k-th undamped one; 0 where one is not found.
   work: 3 n lanes; single: n (2 n + 3) numbers of each kind. */
static int mode(int n, int k, const v *C, const v *mu, c *rate, c *u, c *work, double *real, z *single)
{
    v decay = C[k * n + k] / 2, stiff = mu[k] - decay * decay;
    if (any(~(stiff > 0))) return 0;
    c l = both(-decay, roots(stiff)), square = product(l, l), *first = work + 2 * n;
    for (int j = 0; j < n; j++) {
        c own = both(square.re + l.re * C[j * n + j] + mu[j], square.im + l.im * C[j * n + j]);
        c share = product(times(-C[j * n + k], l), inverse(own));
        u[j] = j == k ? both(0 * decay + 1, 0 * decay) : choice(size(share) < 1, share, times(0 * decay, l));
        first[j] = u[j];
    }
    *rate = l;
    flags done = weakly_coupled(n, k, C, mu, rate, u, work);
    for (int p = 0; p < LANES; p++) {
        if (done[p]) continue;
        z *own = single, one = l.re[p] + I * l.im[p];
        for (int i = 0; i < n * n; i++) real[i] = C[i][p];
        for (int j = 0; j < n; j++) {
            real[n * n + j] = mu[j][p];
            own[j] = first[j].re[p] + I * first[j].im[p];
        }
        if (!strongly_coupled(n, real, real + n * n, &one, own, single + n)) return 0;
        rate->re[p] = creal(one), rate->im[p] = cimag(one);
        for (int j = 0; j < n; j++) u[j].re[p] = creal(own[j]), u[j].im[p] = cimag(own[j]);
    }
    return 1;
}

/* u := u / root(ut (2 l + C) u), what Y [x; lambda x] = 1 asks for; 0 where that nearly vanishes. */
static int scaled(int n, const v *C, c rate, c *u)
{
    c scale = times(0 * rate.re, rate);
    v total = {0};
    for (int i = 0; i < n; i++) {
        c s = times(2 * (0 * total + 1), product(rate, u[i]));
        for (int j = 0; j < n; j++) s = sum(s, times(C[i * n + j], u[j]));
        scale = sum(scale, product(u[i], s));
        total += u[i].re * u[i].re + u[i].im * u[i].im;
    }
    if (any(~(length(scale) > 1e-6 * length(rate) * total))) return 0;
    scale = inverse(complex_root(scale));
    for (int i = 0; i < n; i++) u[i] = product(scale, u[i]);
    return 1;
}

/* Whether the scaled modes are different ones, and all: Y X = 1 to 1e-9; work (n, n). */
static int complete(int n, const v *C, const c *rate, const c *u, c *work)
{
    v most = {0};
    for (int k = 0; k < n; k++)
        for (int a = 0; a < n; a++) {
            c s = times(C[a * n], u[k * n]);
            for (int b = 1; b < n; b++) s = sum(s, times(C[a * n + b], u[k * n + b]));
            work[k * n + a] = s;
        }
    for (int j = 0; j < n; j++)
        for (int k = 0; k <= j; k++) {
            v rr = {0}, ii = rr, ri = rr, ir = rr, RR = rr, II = rr, RI = rr, IR = rr;
            for (int a = 0; a < n; a++) {  /* of real and imaginary parts */
                c own = u[j * n + a], other = u[k * n + a], damped = work[k * n + a];
                rr += own.re * other.re, ii += own.im * other.im;
                ri += own.re * other.im, ir += own.im * other.re;
                RR += own.re * damped.re, II += own.im * damped.im;
                RI += own.re * damped.im, IR += own.im * damped.re;
            }
            c same = both(rr - ii, ri + ir), across = both(rr + ii, ir - ri);
            c plus = both(rate[j].re + rate[k].re, rate[j].im + rate[k].im);
            c minus = both(plus.re, rate[j].im - rate[k].im);
            v one = size(sum(product(plus, same), both(RR - II, RI + IR)));
            v two = size(sum(product(minus, across), both(RR + II, IR - RI)));
            if (j != k) most = pick(one <= most, most, one);
            most = pick(two <= most, most, two);
            if (any(~(most < 1e-9))) return 0;
        }
    return 1;
}

/* Up to eight sets from M, D, K (sets, 3, n, n) into lanes, the last again where they are fewer. */
static void gathered(long sets, int n, const double *parts, v *out)
{
    for (int p = 0; p < LANES; p++) {
        const double *own = parts + (p < sets ? p : sets - 1) * 3L * n * n;
        for (int i = 0; i < 3 * n * n; i++) out[i][p] = own[i];
    }
}

/* out := A x with a real A. */
static void applied(int n, const v *A, const c *x, c *out)
{
    for (int i = 0; i < n; i++) {
        c s = times(A[i * n], x[0]);
        for (int j = 1; j < n; j++) s = sum(s, times(A[i * n + j], x[j]));
        out[i] = s;
    }
}

/* Right and left vectors of lanes' modes (n of 3 n each: x, M x, l M x + D x) in their place. */
static void placed(long sets, int n, const c *l, const c *found, double *rates, double *right, double *left)
{
    for (int p = 0; p < sets; p++)
        for (int k = 0; k < n; k++) {
            int place = 0;  /* by rising |l| */
            double own = l[k].re[p] * l[k].re[p] + l[k].im[p] * l[k].im[p];
            for (int j = 0; j < n; j++) {
                double other = l[j].re[p] * l[j].re[p] + l[j].im[p] * l[j].im[p];
                place += other < own || (other == own && j < k);
            }
            long at = p * n + place;
            double *x = right + 2 * at * n, *y = left + 4 * at * n;
            const c *from = found + 3 * k * n;
            rates[2 * at] = l[k].re[p], rates[2 * at + 1] = l[k].im[p];
            for (int i = 0; i < n; i++) {
                x[2 * i] = from[i].re[p], x[2 * i + 1] = from[i].im[p];
                y[2 * (n + i)] = from[n + i].re[p], y[2 * (n + i) + 1] = from[n + i].im[p];
                y[2 * i] = from[2 * n + i].re[p], y[2 * i + 1] = from[2 * n + i].im[p];
            }
        }
}

/* Modes by rising |lambda| at `points` sets of M, D, K (points, 3, n, n): rate (points, n), right
   vectors (points, n modes, n), left ones (points, n modes, 2n) with Y [x; lambda x] = 1.
   Returns 0 where a set's are not found: not oscillating but by round-off, nearly equal or nearly critical. */
int damped_modes(long points, int n, const double *parts, double *rates, double *right, double *left)
{
    long nn = (long)n * n;
    v *all = aligned_alloc(sizeof(v), (19 * nn + 9 * n) * sizeof(v)), *M = all, *D = M + nn, *K = D + nn;
    v *L = K + nn, *W = L + nn, *A = W + nn, *C = A + nn, *work = C + nn, *V = work + nn, *mu = V + nn;
    c *u = (c *)(mu + n), *rest = u + nn, *l = rest + nn + 3 * n, *found = l + n;
    double *real = calloc(nn + n, sizeof(double));
    z *single = calloc(nn + 2 * n, sizeof(z));
    int good = all && real && single;
    for (long p = 0; p < points && good; p += LANES) {
        long sets = points - p < LANES ? points - p : LANES;
        gathered(sets, n, parts + 3 * p * nn, M);
        if (p % (16 * LANES) == 0)  /* before round-off adds up */
            for (int i = 0; i < nn; i++) V[i] = 0 * M[i] + (i % (n + 1) == 0);
        memcpy(L, M, nn * sizeof(v));
        if (!(good = cholesky(n, L))) break;
        lifted(n, L, V, W);  /* the basis of the last sets first */
        congruent(n, K, W, A, work);
        if (!(good = diagonal(n, A, V))) break;
        lifted(n, L, V, W);
        congruent(n, D, W, C, work);
        v most = 0 * A[0];
        for (int k = 0; k < n; k++) mu[k] = A[k * n + k], most = larger(mu[k], most);
        for (int k = 0; k < n; k++) good = good && !any(~(mu[k] > 1e-12 * most));  /* not by round-off */
        for (int k = 0; k < n && good; k++)
            good = mode(n, k, C, mu, l + k, u + k * n, rest, real, single) && scaled(n, C, l[k], u + k * n);
        if (!good || !(good = complete(n, C, l, u, rest))) break;
        for (int k = 0; k < n; k++) {
            c *x = found + 3 * k * n, *mass = x + n, *damping = mass + n;
            applied(n, W, u + k * n, x);
            applied(n, M, x, mass);
            applied(n, D, x, damping);
            for (int i = 0; i < n; i++) damping[i] = sum(damping[i], product(l[k], mass[i]));
        }
        placed(sets, n, l, found, rates + 2 * p * n, right + 2 * p * nn, left + 4 * p * nn);
    }
    free(all);
    free(real);
    free(single);
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
                int close = modulus(gap) * t < near, beside = modulus(across) * t < near;
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
