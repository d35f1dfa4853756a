/* Trajectories of a Lagrangian system with derivatives, one parameter set after the other.
 *
 * Before this text stand the macros N (coordinates), OWN (uncertain parameters), REST (others),
 * OUT (outputs) and the functions made from the system's expressions: each takes the arguments x
 * and writes values, first derivatives by the active arguments (they come first in x), and the
 * upper triangle of the second ones. The twin is nonlinear.py. */

#define ACTIVE_MOST (2 * N + OWN)
#define PAIRS(a) ((a) * ((a) + 1) / 2)
#define ROWS_MOST (2 * N > OUT ? 2 * N : OUT)
#define SIZE (ROWS_MOST * (1 + ACTIVE_MOST + PAIRS(ACTIVE_MOST)))

typedef struct {
    double value[2 * N], first[2 * N][OWN + 1], second[2 * N][OWN + 1][OWN + 1];
} State;

static int inverse(const double *given, double *out)
{
    double A[N * N];
    memcpy(A, given, sizeof A);
    for (int i = 0; i < N * N; i++) out[i] = i % (N + 1) == 0;
    for (int k = 0; k < N; k++) {
        int p = k;
        for (int i = k + 1; i < N; i++)
            if (fabs(A[i * N + k]) > fabs(A[p * N + k])) p = i;
        if (!(fabs(A[p * N + k]) > 0)) return 0;
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

/* Second derivatives of rows of a function along `a` active arguments with slopes F[a][d]. */
static void bent(int rows, int a, int d, const double *flat, double F[][OWN + 1],
                 double out[][OWN + 1][OWN + 1])
{
    const double *H = flat + rows * (1 + a);
    for (int m = 0; m < rows; m++, H += PAIRS(a)) {
        double half[ACTIVE_MOST][OWN + 1];
        memset(half, 0, sizeof half);
        const double *entry = H;
        for (int p = 0; p < a; p++)
            for (int q = p; q < a; q++, entry++) {
                if (*entry == 0) continue;
                for (int i = 0; i < d; i++) half[p][i] += *entry * F[q][i];
                if (p != q)
                    for (int i = 0; i < d; i++) half[q][i] += *entry * F[p][i];
            }
        for (int i = 0; i < d; i++)
            for (int j = i; j < d; j++) {
                double total = 0;
                for (int p = 0; p < a; p++) total += F[p][i] * half[p][j];
                out[m][i][j] = out[m][j][i] = total;
            }
    }
}

/* A function's jet along the state, the first 2N active arguments, and the parameters. */
static void chain(int rows, int d, const double *flat, const State *s, double value[],
                  double first[][OWN + 1], double second[][OWN + 1][OWN + 1])
{
    const int a = 2 * N + OWN;
    double F[ACTIVE_MOST][OWN + 1];
    memset(F, 0, sizeof F);
    for (int p = 0; p < 2 * N; p++) memcpy(F[p], s->first[p], d * sizeof(double));
    for (int p = 0; p < OWN; p++) F[2 * N + p][p] = 1;
    bent(rows, a, d, flat, F, second);
    for (int m = 0; m < rows; m++) {
        const double *g = flat + rows + m * a;
        value[m] = flat[m];
        for (int i = 0; i < d; i++) {
            double total = 0;
            for (int p = 0; p < a; p++) total += g[p] * F[p][i];
            first[m][i] = total;
            for (int j = 0; j < d; j++)
                for (int p = 0; p < 2 * N; p++) second[m][i][j] += g[p] * s->second[p][i][j];
        }
    }
}

#ifdef VARIATIONAL
static int step(State *s, const double *par, double h, int d, double *last)
{
    double x[2 * N + OWN + REST + 1], flat[SIZE], J[N * N], inv[N * N], change[N];
    int done = 0;
    for (int i = 0; i < N; i++) x[i] = x[N + i] = s->value[i];
    memcpy(x + 2 * N, par, (OWN + REST) * sizeof(double));
    x[2 * N + OWN + REST] = h;
    for (int count = 0; count < 30 && !done; count++) {
        double most = 0, size = 0;
        newton_values(x, flat);
        memcpy(J, flat + N, sizeof J);
        if (!inverse(J, inv)) return 3;
        for (int i = 0; i < N; i++) {
            change[i] = 0;
            for (int j = 0; j < N; j++) change[i] += inv[i * N + j] * (flat[j] - s->value[N + j]);
            if (!isfinite(change[i])) return 2;
            most = fmax(most, fabs(change[i]));
        }
        for (int i = 0; i < N; i++) {
            x[i] -= change[i];
            size = fmax(size, fabs(x[i]));
        }
        *last = most;
        done = most <= 1e-12 * (1 + size);
    }
    if (!done) return 1;
    if (!d) {
        both_values(x, flat);
        memcpy(s->value, x, N * sizeof(double));
        memcpy(s->value + N, flat + N, N * sizeof(double));
        return 0;
    }
    const int a = 2 * N + OWN;
    double F[ACTIVE_MOST][OWN + 1], curve[2 * N][OWN + 1][OWN + 1];
    State t;
    both_full(x, flat);
    memset(F, 0, sizeof F);
    for (int p = 0; p < N; p++) memcpy(F[N + p], s->first[p], d * sizeof(double));
    for (int p = 0; p < OWN; p++) F[2 * N + p][p] = 1;
    const double *g = flat + 2 * N;
    for (int i = 0; i < d; i++) {
        double right[N];
        for (int m = 0; m < N; m++) {
            right[m] = s->first[N + m][i];
            for (int p = N; p < a; p++) right[m] -= g[m * a + p] * F[p][i];
        }
        for (int m = 0; m < N; m++) {
            F[m][i] = 0;
            for (int k = 0; k < N; k++) F[m][i] += inv[m * N + k] * right[k];
        }
    }
    bent(2 * N, a, d, flat, F, curve);
    for (int i = 0; i < d; i++)
        for (int j = 0; j < d; j++) {
            double new[N];
            for (int m = 0; m < 2 * N; m++)
                for (int p = 0; p < N; p++)
                    curve[m][i][j] += g[m * a + N + p] * s->second[p][i][j];
            for (int m = 0; m < N; m++) {
                new[m] = 0;
                for (int k = 0; k < N; k++)
                    new[m] += inv[m * N + k] * (s->second[N + k][i][j] - curve[k][i][j]);
            }
            for (int m = 0; m < N; m++) {
                t.second[m][i][j] = new[m];
                t.second[N + m][i][j] = curve[N + m][i][j];
                for (int k = 0; k < N; k++) t.second[N + m][i][j] += g[(N + m) * a + k] * new[k];
            }
        }
    for (int m = 0; m < N; m++) {
        t.value[m] = x[m];
        t.value[N + m] = flat[N + m];
        for (int i = 0; i < d; i++) {
            t.first[m][i] = F[m][i];
            t.first[N + m][i] = 0;
            for (int p = 0; p < a; p++) t.first[N + m][i] += g[(N + m) * a + p] * F[p][i];
        }
    }
    *s = t;
    return 0;
}
#else
static void moved(State *out, const State *s, const State *k, double h, int d)
{
    for (int m = 0; m < 2 * N; m++) {
        out->value[m] = s->value[m] + h * k->value[m];
        for (int i = 0; i < d; i++) {
            out->first[m][i] = s->first[m][i] + h * k->first[m][i];
            for (int j = 0; j < d; j++)
                out->second[m][i][j] = s->second[m][i][j] + h * k->second[m][i][j];
        }
    }
}

static void slope(State *k, const State *s, const double *par, int d)
{
    double x[2 * N + OWN + REST], flat[SIZE];
    memcpy(x, s->value, sizeof s->value);
    memcpy(x + 2 * N, par, (OWN + REST) * sizeof(double));
    if (!d) {
        flow_values(x, k->value);
        return;
    }
    flow_full(x, flat);
    chain(2 * N, d, flat, s, k->value, k->first, k->second);
}

static int step(State *s, const double *par, double h, int d, double *last)
{
    State k1, k2, k3, k4, at = *s;
    (void)last;
    slope(&k1, s, par, d);
    moved(&at, s, &k1, h / 2, d);
    slope(&k2, &at, par, d);
    moved(&at, s, &k2, h / 2, d);
    slope(&k3, &at, par, d);
    moved(&at, s, &k3, h, d);
    slope(&k4, &at, par, d);
    moved(s, s, &k1, h / 6, d);
    moved(s, s, &k2, h / 3, d);
    moved(s, s, &k3, h / 3, d);
    moved(s, s, &k4, h / 6, d);
    return 0;
}
#endif

/* Outputs at all nodes: value (S, T, OUT), first (d, S, T, OUT), second (d, d, S, T, OUT). */
int march(long sets, long nodes, int d, int parts, const double *lengths, const double *parameters,
          const double *start, const double *start_first, const double *start_second,
          double *value, double *first, double *second, double *last)
{
    for (long set = 0; set < sets; set++) {
        const double *par = parameters + set * (OWN + REST);
        State s;
        memset(&s, 0, sizeof s);
        for (int m = 0; m < 2 * N; m++) {
            s.value[m] = start[m * sets + set];
            for (int i = 0; i < d; i++) {
                s.first[m][i] = start_first[(i * 2 * N + m) * sets + set];
                for (int j = 0; j < d; j++)
                    s.second[m][i][j] = start_second[((i * d + j) * 2 * N + m) * sets + set];
            }
        }
        for (long t = 0; t < nodes; t++) {
            double x[2 * N + OWN + REST], flat[SIZE], f[OUT];
            double g[OUT][OWN + 1], H[OUT][OWN + 1][OWN + 1];
            for (int p = 0; t && p < parts; p++) {
                int failed = step(&s, par, lengths[p], d, last);
                if (failed) return failed;
            }
            memcpy(x, s.value, sizeof s.value);
            memcpy(x + 2 * N, par, (OWN + REST) * sizeof(double));
            if (d) {
                observe_full(x, flat);
                chain(OUT, d, flat, &s, f, g, H);
            } else
                observe_values(x, f);
            for (int o = 0; o < OUT; o++) {
                long at = (set * nodes + t) * OUT + o, all = sets * nodes * OUT;
                value[at] = f[o];
                for (int i = 0; i < d; i++) {
                    first[i * all + at] = g[o][i];
                    for (int j = 0; j < d; j++) second[(i * d + j) * all + at] = H[o][i][j];
                }
            }
        }
    }
    return 0;
}
