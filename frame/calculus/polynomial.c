/* Sums of monomials at points: the twin of polynomial.py. */

#include <stdlib.h>
#include <string.h>

#define LANES 8 /* points in one vector */
#define WIDE 6  /* columns summed together */
#ifdef __AVX512F__
#define GROUPS 2 /* vectors of points that share each coefficient */
#else
#define GROUPS 1
#endif
#define BLOCK (LANES * GROUPS)

typedef double lane __attribute__((vector_size(8 * LANES)));

/* Monomials of BLOCK points: each is that of its parent times a coordinate. */
static void monomials(int terms, const long *axis, const long *parent, const lane *u, lane *basis)
{
    for (int g = 0; g < GROUPS; g++)
        basis[g] = (lane){0} + 1.0;
    for (int t = 1; t < terms; t++)
        for (int g = 0; g < GROUPS; g++)
            basis[t * GROUPS + g] = basis[parent[t] * GROUPS + g] * u[axis[t] * GROUPS + g];
}

/* WIDE columns of sums over the first `terms` monomials; c: (terms, WIDE). */
static void sums(long terms, const lane *basis, const double *c, lane total[WIDE][GROUPS])
{
    lane own[WIDE][GROUPS] = {{{0}}};
    for (long t = 0; t < terms; t++, c += WIDE)
        for (int w = 0; w < WIDE; w++)
            for (int g = 0; g < GROUPS; g++)
                own[w][g] += basis[t * GROUPS + g] * c[w];
    memcpy(total, own, sizeof own);
}

/* For each part the sums of its first `sizes` monomials at points u (count, d), its `widths` columns
   side by side with those of the others in out (count, all); its coefficients: (blocks of columns,
   sizes, WIDE), the last block padded. */
int monomial_sums(long count, int d, int terms, const long *axis, const long *parent,
                  const double *u, int parts, const long *sizes, const long *widths,
                  const double *const *coefficients, double *out)
{
    lane *basis = aligned_alloc(8 * LANES, (size_t)(terms + d) * GROUPS * sizeof(lane));
    if (!basis) return 0;
    double *point = (double *)(basis + terms * GROUPS);
    long all = 0;
    for (int p = 0; p < parts; p++)
        all += widths[p];
    for (long begin = 0; begin < count; begin += BLOCK) {
        int here = count - begin < BLOCK ? (int)(count - begin) : BLOCK;
        for (int i = 0; i < d; i++)
            for (int l = 0; l < BLOCK; l++)
                point[i * BLOCK + l] = l < here ? u[(begin + l) * d + i] : 0.0;
        monomials(terms, axis, parent, (const lane *)point, basis);
        double *to = out + begin * all;
        for (int p = 0; p < parts; to += widths[p++])
            for (long column = 0; column < widths[p]; column += WIDE) {
                lane total[WIDE][GROUPS];
                int wide = widths[p] - column < WIDE ? (int)(widths[p] - column) : WIDE;
                sums(sizes[p], basis, coefficients[p] + column * sizes[p], total);
                for (int l = 0; l < here; l++)
                    for (int w = 0; w < wide; w++)
                        to[l * all + column + w] = ((double *)total[w])[l];
            }
    }
    free(basis);
    return 1;
}
