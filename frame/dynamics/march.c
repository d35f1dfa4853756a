/* Trajectories of a Lagrangian system with derivatives, W parameter sets side by side.
 *
 * Before this text stand the macros N (coordinates), OWN (uncertain parameters), REST (others),
 * OUT (outputs), the vector V (lanes.h) and the functions made from the system's expressions: each
 * takes the arguments x and writes values, first derivatives by the active arguments (they come
 * first in x, the uncertain parameters last among them), and the upper triangle of the second ones.
 * No lane depends on the others: a converged one stays as it is. The twin is nonlinear.py. */

#define PAIRS(a) ((a) * ((a) + 1) / 2)
#define ACTIVE (2 * N + OWN)
#define ROWS_MOST (2 * N > OUT ? 2 * N : OUT)
#define SIZE (ROWS_MOST * (1 + ACTIVE + PAIRS(ACTIVE)))

typedef long long Mask __attribute__((vector_size(8 * W)));

typedef struct {
    V value[2 * N], first[2 * N][OWN + 1], second[2 * N][PAIRS(OWN) + 1];
} State;

static V chosen(Mask where, V a, V b) { return (V)(((Mask)a & where) | ((Mask)b & ~where)); }
static V larger(V a, V b) { return chosen(a > b, a, b); }
static V magnitude(V x) { return chosen(x < 0, -x, x); }

static int any(Mask where)
{
    long long found = 0;
    for (int l = 0; l < W; l++) found |= where[l];
    return found != 0;
}

static int inverse(double *A, double *out)
{
    for (int i = 0; i < N * N; i++) out[i] = i % (N + 1) == 0;
    for (int k = 0; k < N; k++) {
        int p = k;
        for (int i = k + 1; i < N; i++)
            if ((fabs)(A[i * N + k]) > (fabs)(A[p * N + k])) p = i;
        if (!((fabs)(A[p * N + k]) > 0)) return 0;
        for (int j = 0; j < N; j++) {
            double t = A[k * N + j];
            A[k * N + j] = A[p * N + j];
            A[p * N + j] = t;
            t = out[k * N + j];
            out[k * N + j] = out[p * N + j];
            out[p * N + j] = t;
        }
        double pivot = A[k * N + k];
        for (int j = 0; j < N; j++) {
            A[k * N + j] /= pivot;
            out[k * N + j] /= pivot;
        }
        for (int i = 0; i < N; i++) {
            double f = A[i * N + k];
            if (i == k || f == 0) continue;
            for (int j = 0; j < N; j++) {
                A[i * N + j] -= f * A[k * N + j];
                out[i * N + j] -= f * out[k * N + j];
            }
        }
    }
    return 1;
}

/* Inverses of the lanes that are open; others keep theirs. */
static int inverses(const V *given, V *out, Mask open)
{
    if (N == 1) {
        if (any(open & ~(magnitude(given[0]) > 0))) return 0;
        out[0] = chosen(open, 1 / given[0], out[0]);
        return 1;
    }
    for (int l = 0; l < W; l++) {
        double A[N * N], made[N * N];
        if (!open[l]) continue;
        for (int i = 0; i < N * N; i++) A[i] = given[i][l];
        if (!inverse(A, made)) return 0;
        for (int i = 0; i < N * N; i++) out[i][l] = made[i];
    }
    return 1;
}

/* Second derivatives of rows along the parameters, from slopes F of the 2N arguments before them. */
static void bent(int rows, const V *flat, V F[][OWN + 1], V out[][PAIRS(OWN) + 1])
{
    const V *H = flat + rows * (1 + ACTIVE);
    for (int m = 0; m < rows; m++, H += PAIRS(ACTIVE)) {
        V half[2 * N][OWN + 1];
        const V *own = H + PAIRS(ACTIVE) - PAIRS(OWN);
        for (int p = 0; p < 2 * N; p++)
            for (int i = 0; i < OWN; i++)
                half[p][i] = H[p * ACTIVE - p * (p - 1) / 2 + 2 * N + i - p];
        for (int p = 0; p < 2 * N; p++)
            for (int q = 0; q < 2 * N; q++) {
                int low = p < q ? p : q, high = p < q ? q : p;
                V entry = 0.5 * H[low * ACTIVE - low * (low - 1) / 2 + high - low];
                for (int i = 0; i < OWN; i++) half[p][i] += entry * F[q][i];
            }
        for (int i = 0, e = 0; i < OWN; i++)
            for (int j = i; j < OWN; j++, e++) {
                V total = own[e];
                for (int p = 0; p < 2 * N; p++)
                    total += F[p][i] * half[p][j] + F[p][j] * half[p][i];
                out[m][e] = total;
            }
    }
}

/* A function's jet along the state, its first 2N arguments, and the parameters. */
static void chain(int rows, const V *flat, State *s, V value[], V first[][OWN + 1],
                  V second[][PAIRS(OWN) + 1])
{
    bent(rows, flat, s->first, second);
    for (int m = 0; m < rows; m++) {
        const V *g = flat + rows + m * ACTIVE;
        value[m] = flat[m];
        for (int i = 0; i < OWN; i++) first[m][i] = g[2 * N + i];
        for (int p = 0; p < 2 * N; p++) {
            for (int i = 0; i < OWN; i++) first[m][i] += g[p] * s->first[p][i];
            for (int e = 0; e < PAIRS(OWN); e++) second[m][e] += g[p] * s->second[p][e];
        }
    }
}

#ifdef VARIATIONAL
/* Derivatives of the implicit step, from those of its equations and the inverse of its slopes. */
static void differentiated(State *s, const V *flat, const V *inv)
{
    V F[2 * N][OWN + 1], curve[2 * N][PAIRS(OWN) + 1], right[N];
    const V *g = flat + 2 * N;
    for (int i = 0; i < OWN; i++) {
        for (int m = 0; m < N; m++) {
            right[m] = s->first[N + m][i] - g[m * ACTIVE + 2 * N + i];
            for (int p = 0; p < N; p++) right[m] -= g[m * ACTIVE + N + p] * s->first[p][i];
        }
        for (int m = 0; m < N; m++) {
            F[m][i] = inv[m * N] * right[0];
            for (int k = 1; k < N; k++) F[m][i] += inv[m * N + k] * right[k];
            F[N + m][i] = s->first[m][i];
        }
    }
    bent(2 * N, flat, F, curve);
    for (int e = 0; e < PAIRS(OWN); e++) {
        for (int m = 0; m < 2 * N; m++)
            for (int p = 0; p < N; p++) curve[m][e] += g[m * ACTIVE + N + p] * s->second[p][e];
        for (int m = 0; m < N; m++) right[m] = s->second[N + m][e] - curve[m][e];
        for (int m = 0; m < N; m++) {
            s->second[m][e] = inv[m * N] * right[0];
            for (int k = 1; k < N; k++) s->second[m][e] += inv[m * N + k] * right[k];
        }
        for (int m = 0; m < N; m++) {
            s->second[N + m][e] = curve[N + m][e];
            for (int k = 0; k < N; k++)
                s->second[N + m][e] += g[(N + m) * ACTIVE + k] * s->second[k][e];
        }
    }
    for (int m = 0; m < N; m++)
        for (int i = 0; i < OWN; i++) {
            s->first[m][i] = F[m][i];
            s->first[N + m][i] = g[(N + m) * ACTIVE + 2 * N + i];
            for (int p = 0; p < 2 * N; p++) s->first[N + m][i] += g[(N + m) * ACTIVE + p] * F[p][i];
        }
}

static int step(State *s, const V *par, double h, int d, double *last)
{
    V x[2 * N + OWN + REST + 1], flat[SIZE], inv[N * N], change[N];
    Mask open = ~(Mask){0};
    for (int i = 0; i < N; i++) x[i] = x[N + i] = s->value[i];
    memcpy(x + 2 * N, par, (OWN + REST) * sizeof(V));
    x[2 * N + OWN + REST] = BROAD(h);
    memset(inv, 0, sizeof inv);
    for (int count = 0; count < 30 && any(open); count++) {
        V most = {0}, size = {0};
        newton_values(x, flat);
        if (!inverses(flat + N, inv, open)) return 3;
        for (int i = 0; i < N; i++) {
            change[i] = (V){0};
            for (int j = 0; j < N; j++) change[i] += inv[i * N + j] * (flat[j] - s->value[N + j]);
            if (any(open & ~(change[i] - change[i] == 0))) return 2;
            most = larger(most, magnitude(change[i]));
        }
        for (int i = 0; i < N; i++) {
            x[i] = chosen(open, x[i] - change[i], x[i]);
            size = larger(size, magnitude(x[i]));
        }
        open &= ~(most <= 1e-12 * (1 + size));
        *last = 0;
        for (int l = 0; l < W; l++)
            if (open[l] && most[l] > *last) *last = most[l];
    }
    if (any(open)) return 1;
    if (d) {
        both_full(x, flat);
        differentiated(s, flat, inv);
    } else
        both_values(x, flat);
    memcpy(s->value, x, N * sizeof(V));
    memcpy(s->value + N, flat + N, N * sizeof(V));
    return 0;
}
#else
static void moved(State *out, const State *s, const State *k, double h)
{
    V *to = (V *)out;
    const V *from = (const V *)s, *along = (const V *)k;
    for (size_t i = 0; i < sizeof(State) / sizeof(V); i++) to[i] = from[i] + h * along[i];
}

static void slope(State *k, State *s, const V *par, int d)
{
    V x[2 * N + OWN + REST], flat[SIZE];
    memcpy(x, s->value, sizeof s->value);
    memcpy(x + 2 * N, par, (OWN + REST) * sizeof(V));
    if (!d) {
        flow_values(x, k->value);
        return;
    }
    flow_full(x, flat);
    chain(2 * N, flat, s, k->value, k->first, k->second);
}

static int step(State *s, const V *par, double h, int d, double *last)
{
    State k1, k2, k3, k4, at = *s;
    (void)last;
    memset(&k1, 0, sizeof k1);
    k2 = k3 = k4 = k1;
    slope(&k1, s, par, d);
    moved(&at, s, &k1, h / 2);
    slope(&k2, &at, par, d);
    moved(&at, s, &k2, h / 2);
    slope(&k3, &at, par, d);
    moved(&at, s, &k3, h);
    slope(&k4, &at, par, d);
    moved(s, s, &k1, h / 6);
    moved(s, s, &k2, h / 3);
    moved(s, s, &k3, h / 3);
    moved(s, s, &k4, h / 6);
    return 0;
}
#endif

/* One lane's outputs at one node: value (OUT), first (OUT, OWN), second (OUT, OWN, OWN). */
static void written(int l, int d, const V *f, V g[][OWN + 1], V H[][PAIRS(OWN) + 1], double *value,
                    double *first, double *second)
{
    for (int o = 0; o < OUT; o++) {
        value[o] = f[o][l];
        if (!d) continue;
        for (int i = 0, e = 0; i < OWN; i++) {
            first[o * OWN + i] = g[o][i][l];
            for (int j = i; j < OWN; j++, e++)
                second[(o * OWN + i) * OWN + j] = second[(o * OWN + j) * OWN + i] = H[o][e][l];
        }
    }
}

/* Sets from `begin` on: outputs at all nodes, (S, T, OUT), and their derivatives behind. */
static int several(long begin, long sets, long nodes, int d, int parts, const double *lengths,
                   const double *parameters, const double *start, const double *start_first,
                   const double *start_second, double *value, double *first, double *second,
                   double *last)
{
    V par[OWN + REST + 1];
    State s;
    memset(&s, 0, sizeof s);
    for (int l = 0; l < W; l++) {
        long set = begin + l < sets ? begin + l : sets - 1;
        for (int k = 0; k < OWN + REST; k++) par[k][l] = parameters[set * (OWN + REST) + k];
        for (int m = 0; m < 2 * N; m++) {
            s.value[m][l] = start[m * sets + set];
            for (int i = 0, e = 0; d && i < OWN; i++) {
                s.first[m][i][l] = start_first[(i * 2 * N + m) * sets + set];
                for (int j = i; j < OWN; j++, e++)
                    s.second[m][e][l] = start_second[((i * d + j) * 2 * N + m) * sets + set];
            }
        }
    }
    for (long t = 0; t < nodes; t++) {
        V x[2 * N + OWN + REST], flat[SIZE], f[OUT], g[OUT][OWN + 1], H[OUT][PAIRS(OWN) + 1];
        for (int p = 0; t && p < parts; p++) {
            int failed = step(&s, par, lengths[p], d, last);
            if (failed) return failed;
        }
        memcpy(x, s.value, sizeof s.value);
        memcpy(x + 2 * N, par, (OWN + REST) * sizeof(V));
        if (d) {
            observe_full(x, flat);
            chain(OUT, flat, &s, f, g, H);
        } else
            observe_values(x, f);
        for (int l = 0; l < W && begin + l < sets; l++) {
            long at = ((begin + l) * nodes + t) * OUT;
            written(l, d, f, g, H, value + at, first + at * OWN, second + at * OWN * OWN);
        }
    }
    return 0;
}

int march(long sets, long nodes, int d, int parts, const double *lengths, const double *parameters,
          const double *start, const double *start_first, const double *start_second,
          double *value, double *first, double *second, double *last)
{
    for (long begin = 0; begin < sets; begin += W) {
        int failed = several(begin, sets, nodes, d, parts, lengths, parameters, start, start_first,
                             start_second, value, first, second, last);
        if (failed) return failed;
    }
    return 0;
}
