/* Outputs y[k] = C x[k] of x[k+1] = T x[k] + G load[k] with their derivatives by d parameters.

   A jet has 1 + d + d (d + 1) / 2 parts: the value, the first derivatives, the second ones i <= j. A matrix is
   kept by columns, each padded to whole vectors; a product takes the columns of one part times the entries of
   another, and leaves out parts of the matrix that are zero. */

#include <stdlib.h>
#include <string.h>

#define W 8
#define INLINE static inline __attribute__((always_inline))
typedef double V __attribute__((vector_size(8 * W)));
typedef double Loose __attribute__((vector_size(8 * W), aligned(8)));

typedef struct {
    int rows, columns, tall; /* tall: vectors in a column */
    V *part;                 /* (parts, columns, tall) */
    char *zero;              /* (parts) */
} Matrix;

INLINE int parts_of(int d) { return 1 + d + d * (d + 1) / 2; }

INLINE int second(int d, int i, int j) /* place of a second derivative */
{
    int low = i < j ? i : j, high = i < j ? j : i;
    return 1 + d + low * d - low * (low - 1) / 2 + high - low;
}

/* Where a part begins in arrays of values (S, size), first (d, S, size) and second derivatives (d, d, S, size). */
static const double *given(const double *const *jet, int d, long samples, long s, long size, int i, int j)
{
    if (i < 0) return jet[0] + s * size;
    if (j < 0) return jet[1] + (i * samples + s) * size;
    return jet[2] + (((long)i * d + j) * samples + s) * size;
}

static void fill(Matrix a, int p, const double *from)
{
    V *column = a.part + (long)p * a.columns * a.tall;
    memset(column, 0, sizeof(V) * a.columns * a.tall);
    a.zero[p] = 1;
    for (int b = 0; b < a.columns; b++)
        for (int r = 0; r < a.rows; r++) {
            double x = from[r * a.columns + b];
            ((double *)(column + b * a.tall))[r] = x;
            if (x != 0) a.zero[p] = 0;
        }
}

static void take(Matrix a, const double *const *jet, int d, long samples, long s)
{
    long size = (long)a.rows * a.columns;
    fill(a, 0, given(jet, d, samples, s, size, -1, -1));
    for (int i = 0; i < d; i++) {
        fill(a, 1 + i, given(jet, d, samples, s, size, i, -1));
        for (int j = i; j < d; j++) fill(a, second(d, i, j), given(jet, d, samples, s, size, i, j));
    }
}

/* y = keep y + factor a x for one part of the matrix, by two sums that do not wait for each other. */
INLINE void add(V *restrict y, const V *restrict a, const double *restrict x, int n, int tall, int keep, double factor)
{
    for (int v = 0; v < tall; v++) {
        V even = {0}, odd = {0};
        for (int b = 0; b < n - 1; b += 2) {
            even += a[b * tall + v] * x[b];
            odd += a[(b + 1) * tall + v] * x[b + 1];
        }
        if (n % 2) even += a[(n - 1) * tall + v] * x[n - 1];
        even = factor * (even + odd);
        y[v] = keep ? y[v] + even : even;
    }
}

/* y = a x as jets; a part of x has `stride` numbers. */
INLINE void product(V *restrict y, Matrix a, const double *restrict x, int n, int tall, int stride, int d)
{
    const long size = (long)n * tall;
    for (int p = 0; p < parts_of(d); p++) add(y + p * tall, a.part, x + p * stride, n, tall, 0, 1);
    for (int i = 0; i < d; i++) {
        const V *slope = a.part + (1 + i) * size;
        if (a.zero[1 + i]) continue;
        add(y + (1 + i) * tall, slope, x, n, tall, 1, 1);
        for (int j = 0; j < d; j++)
            add(y + second(d, i, j) * tall, slope, x + (1 + j) * stride, n, tall, 1, i == j ? 2 : 1);
    }
    for (int p = 1 + d; p < parts_of(d); p++)
        if (!a.zero[p]) add(y + p * tall, a.part + p * size, x, n, tall, 1, 1);
}

INLINE void store(double *to, const V *y, int m, long room)
{
    if (m <= W && room >= W) /* what is too much, the next node overwrites */
        *(Loose *)to = (Loose)*y;
    else
        memcpy(to, y, sizeof(double) * m);
}

/* One set of parameters; n, tall and wide are constants where they are common. */
INLINE void march(Matrix T, Matrix G, Matrix C, V *x, V *next, V *y, const double *load, long count, int d,
                  double *const *out, long samples, long s, int n, int tall, int wide)
{
    const int parts = parts_of(d), m = C.rows, loads = G.columns;
    const long all = samples * count * m;
    for (long k = 0; k < count; k++) {
        const long at = (s * count + k) * m, room = (count - k) * m;
        product(y, C, (double *)x, n, wide, W * tall, d);
        store(out[0] + at, y, m, room);
        for (int i = 0; i < d; i++) {
            store(out[1] + i * all + at, y + (1 + i) * wide, m, room);
            for (int j = 0; j < d; j++)
                store(out[2] + (i * d + j) * all + at, y + second(d, i, j) * wide, m, room);
        }
        if (k == count - 1) break;
        product(next, T, (double *)x, n, tall, W * tall, d);
        for (int p = 0; p < parts && loads; p++)
            if (!G.zero[p]) add(next + p * tall, G.part + (long)p * loads * tall, load + k * loads, loads, tall, 1, 1);
        V *old = x;
        x = next, next = old;
    }
}

static V *vectors(long count) { return aligned_alloc(sizeof(V), sizeof(V) * (count ? count : 1)); }

static Matrix matrix(int rows, int columns, int parts)
{
    int tall = (rows + W - 1) / W;
    return (Matrix){rows, columns, tall, vectors((long)parts * columns * tall), calloc(parts, 1)};
}

/* jets: value, first and second derivatives of T (n, n), G (n, loads), the start (n, 1) and C (m, n), each with the
   samples before its own shape and the directions before these; out: those of the outputs (count, m).
   0 when there is no memory. */
int linear_march(long samples, long count, int n, int m, int d, int loads, const double *load,
                 const double *const *jets, double *const *out)
{
    const int parts = parts_of(d);
    Matrix T = matrix(n, n, parts), G = matrix(n, loads, parts), C = matrix(m, n, parts), start = matrix(n, 1, parts);
    V *next = vectors((long)parts * T.tall), *y = vectors((long)parts * C.tall);
    int good = T.part && G.part && C.part && start.part && next && y && T.zero && G.zero && C.zero && start.zero;
    for (long s = 0; good && s < samples; s++) {
        take(T, jets, d, samples, s);
        if (loads) take(G, jets + 3, d, samples, s);
        take(start, jets + 6, d, samples, s);
        take(C, jets + 9, d, samples, s);
#define MARCH(n, tall, wide) march(T, G, C, start.part, next, y, load, count, d, out, samples, s, n, tall, wide)
        if (C.tall == 1 && n == 2)
            MARCH(2, 1, 1);
        else if (C.tall == 1 && n == 4)
            MARCH(4, 1, 1);
        else if (C.tall == 1 && n == 6)
            MARCH(6, 1, 1);
        else if (C.tall == 1 && n == 8)
            MARCH(8, 1, 1);
        else if (C.tall == 1 && T.tall == 2)
            MARCH(n, 2, 1);
        else
            MARCH(n, T.tall, C.tall);
    }
    free(T.part), free(G.part), free(C.part), free(start.part), free(next), free(y);
    free(T.zero), free(G.zero), free(C.zero), free(start.zero);
    return good;
}
