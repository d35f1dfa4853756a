/* Cholesky factors of matrices of one pattern, eight of them side by side: L Lᵀ = A, every operation
   one on eight numbers. Columns of L of one pattern below their common triangle are a group, and are
   taken four at a time. Inverse pivots stand in the place of the pivots. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { LANES = 8, AT_ONCE = 4 };
typedef double lanes __attribute__((vector_size(LANES * sizeof(double))));

typedef struct {
    int size, entries, count, batches;
    int *start, *rows;  /* columns of L: where they begin (size + 1), and their rising rows */
    int *first, *last;  /* the group of each column: its first column, and the one after its last */
    int *place;         /* in L of every entry of A */
    lanes *values;      /* of L, batch after batch */
} factors;

static int rising(const void *a, const void *b) { return *(const int *)a - *(const int *)b; }

static int *integers(size_t count) { return calloc(count + 1, sizeof(int)); }

/* Rows of L, column by column: those of A's column and of the columns whose first row below the
   diagonal it is. */
static int fill_in(factors *f, const int *row, const int *column) {
    int n = f->size, room = 4 * f->entries + n;
    int *begin = integers(n), *below = integers(f->entries), *mark = integers(n);
    int *child = integers(n), *next = integers(n);
    f->rows = malloc(room * sizeof(int));
    for (int e = 0; e < f->entries; e++) begin[column[e] + 1]++;
    for (int j = 0; j < n; j++) begin[j + 1] += begin[j];
    memcpy(next, begin, n * sizeof(int));
    for (int e = 0; e < f->entries; e++) below[next[column[e]]++] = row[e];
    memset(child, -1, n * sizeof(int)), memset(mark, -1, n * sizeof(int));
    for (int j = 0; j < n && f->rows; j++) {
        int count = f->start[j];
        if (count + n > room) f->rows = realloc(f->rows, (room = 2 * room + n) * sizeof(int));
        if (!f->rows) break;
        for (int k = begin[j]; k < begin[j + 1]; k++)
            if (mark[below[k]] != j) mark[f->rows[count++] = below[k]] = j;
        for (int c = child[j]; c >= 0; c = next[c])
            for (int k = f->start[c] + 1; k < f->start[c + 1]; k++)
                if (mark[f->rows[k]] != j) mark[f->rows[count++] = f->rows[k]] = j;
        qsort(f->rows + f->start[j], count - f->start[j], sizeof(int), rising);
        f->start[j + 1] = count;
        if (count - f->start[j] > 1) {
            int parent = f->rows[f->start[j] + 1];
            next[j] = child[parent], child[parent] = j;
        }
    }
    free(begin), free(below), free(mark), free(child), free(next);
    return f->rows != NULL;
}

static void find_groups(factors *f) {
    for (int j = 0, first = 0; j < f->size; j++) {
        int length = f->start[j + 1] - f->start[j], after = j + 1;
        f->first[j] = first;
        int joined = after < f->size && length > 1 && f->rows[f->start[j] + 1] == after
                     && f->start[after + 1] - f->start[after] == length - 1;
        if (joined) continue;
        for (int k = first; k < after; k++) f->last[k] = after;
        first = after;
    }
}

void discard(factors *f) {
    free(f->start), free(f->rows), free(f->first), free(f->last), free(f->place), free(f->values);
    free(f);
}

/* Factors for matrices of entries in the lower triangle, `row` >= `column`, each named once and all
   diagonal ones among them. */
factors *prepare(int size, int entries, const int *row, const int *column) {
    factors *f = calloc(1, sizeof(factors));
    f->size = size, f->entries = entries;
    f->start = integers(size), f->first = integers(size), f->last = integers(size);
    f->place = integers(entries);
    if (!fill_in(f, row, column)) return discard(f), NULL;
    find_groups(f);
    for (int e = 0; e < entries; e++) {
        int *from = f->rows + f->start[column[e]], *to = f->rows + f->start[column[e] + 1];
        f->place[e] = (int *)bsearch(row + e, from, to - from, sizeof(int), rising) - f->rows;
    }
    return f;
}

/* Take from `sum` what `count` columns, each from the row `rows[0]` on, give to that row's column. */
static void subtract(lanes *restrict sum, const int *rows, int length, lanes **from, int count) {
    for (; count >= AT_ONCE; from += AT_ONCE, count -= AT_ONCE) {
        const lanes *a = from[0], *b = from[1], *c = from[2], *d = from[3];
        lanes p = *a, q = *b, r = *c, s = *d;
        for (int k = 0; k < length; k++) sum[rows[k]] -= a[k] * p + b[k] * q + (c[k] * r + d[k] * s);
    }
    for (; count >= 2; from += 2, count -= 2) {
        const lanes *a = from[0], *b = from[1];
        lanes p = *a, q = *b;
        for (int k = 0; k < length; k++) sum[rows[k]] -= a[k] * p + b[k] * q;
    }
    if (count) {
        const lanes *a = from[0];
        lanes p = *a;
        for (int k = 0; k < length; k++) sum[rows[k]] -= a[k] * p;
    }
}

/* One batch from its entries in `values`; 0 where a pivot is not positive. Groups wait in the list of
   the next row that they give to. */
static int eliminate(const factors *f, lanes *values, lanes *sum, int *list, lanes **from) {
    int n = f->size, *waiting = list, *next = list + n, *given = list + 2 * n;
    memset(waiting, -1, n * sizeof(int)), memset(sum, 0, n * sizeof(lanes));
    for (int j = 0; j < n; j++) {
        int begin = f->start[j], end = f->start[j + 1], length = end - begin;
        const int *rows = f->rows + begin;
        for (int k = 0; k < length; k++) sum[rows[k]] = values[begin + k];
        for (int k = f->first[j]; k < j; k++) from[k - f->first[j]] = values + f->start[k] + j - k;
        subtract(sum, rows, length, from, j - f->first[j]);
        for (int g = waiting[j], after; g >= 0; g = after) {
            int last = f->last[g], at = given[g]++, stop = f->start[last] - f->start[last - 1] - 1;
            after = next[g];
            for (int k = g; k < last; k++) from[k - g] = values + f->start[k] + last - k + at;
            const int *below = f->rows + f->start[last - 1] + 1 + at;
            subtract(sum, below, stop - at, from, last - g);
            if (at + 1 < stop) next[g] = waiting[below[1]], waiting[below[1]] = g;
        }
        lanes pivot = sum[j];
        for (int k = 0; k < LANES; k++) {
            if (!(pivot[k] > 0)) return 0;
            pivot[k] = 1 / sqrt(pivot[k]);
        }
        values[begin] = pivot;
        for (int k = 1; k < length; k++) values[begin + k] = sum[rows[k]] * pivot;
        if (j + 1 == f->last[j] && length > 1) {
            int g = f->first[j];
            given[g] = 0, next[g] = waiting[rows[1]], waiting[rows[1]] = g;
        }
    }
    return 1;
}

/* Factors of `count` matrices, `entries` of each; 0, 1 where one is not positive definite, 2 without
   memory. */
int factorise(factors *f, int count, const double *entries) {
    size_t n = f->size, length = f->start[n];
    f->count = count, f->batches = (count + LANES - 1) / LANES;
    free(f->values);
    f->values = aligned_alloc(sizeof(lanes), f->batches * length * sizeof(lanes));
    lanes *sum = aligned_alloc(sizeof(lanes), n * sizeof(lanes)), **from = malloc(n * sizeof(lanes *));
    int *list = integers(3 * n), status = f->values && sum && from && list ? 0 : 2;
    for (int b = 0; b < f->batches && !status; b++) {
        lanes *values = f->values + b * length;
        memset(values, 0, length * sizeof(lanes));
        for (int k = 0; k < LANES; k++) {
            int one = b * LANES + k < count ? b * LANES + k : count - 1;
            const double *own = entries + (size_t)one * f->entries;
            for (int e = 0; e < f->entries; e++) values[f->place[e]][k] = own[e];
        }
        status = !eliminate(f, values, sum, list, from);
    }
    free(sum), free(from), free(list);
    return status;
}

#define INLINE static inline __attribute__((always_inline))

/* L x = x for `columns` vectors, from column j of L and `wide` - 1 more of its group on. */
INLINE void lower(const factors *f, const lanes *values, lanes *x, int j, int wide, int columns) {
    lanes known[AT_ONCE][AT_ONCE];
    const lanes *from[AT_ONCE];
    for (int k = 0; k < wide; k++) {
        from[k] = values + f->start[j + k] + wide - k;
        for (int c = 0; c < columns; c++) {
            lanes sum = x[(j + k) * columns + c];
            for (int i = 0; i < k; i++) sum -= from[i][k - wide] * known[i][c];
            x[(j + k) * columns + c] = known[k][c] = sum * from[k][k - wide];
        }
    }
    int length = f->start[j + wide] - f->start[j + wide - 1] - 1;
    const int *rows = f->rows + f->start[j + wide] - length;
    for (int q = 0; q < length; q++) {
        lanes *target = x + (size_t)rows[q] * columns;
        for (int c = 0; c < columns; c++) {
            lanes sum = target[c];
            for (int k = 0; k < wide; k++) sum -= from[k][q] * known[k][c];
            target[c] = sum;
        }
    }
}

/* Lᵀ x = x likewise. */
INLINE void upper(const factors *f, const lanes *values, lanes *x, int j, int wide, int columns) {
    lanes sums[AT_ONCE][AT_ONCE];
    const lanes *from[AT_ONCE];
    for (int k = 0; k < wide; k++) {
        from[k] = values + f->start[j + k] + wide - k;
        for (int c = 0; c < columns; c++) sums[k][c] = x[(j + k) * columns + c];
    }
    int length = f->start[j + wide] - f->start[j + wide - 1] - 1;
    const int *rows = f->rows + f->start[j + wide] - length;
    for (int q = 0; q < length; q++) {
        const lanes *source = x + (size_t)rows[q] * columns;
        for (int c = 0; c < columns; c++)
            for (int k = 0; k < wide; k++) sums[k][c] -= from[k][q] * source[c];
    }
    for (int k = wide - 1; k >= 0; k--)
        for (int c = 0; c < columns; c++) {
            for (int i = k + 1; i < wide; i++) sums[k][c] -= from[k][i - wide] * x[(j + i) * columns + c];
            x[(j + k) * columns + c] = sums[k][c] * from[k][k - wide];
        }
}

INLINE void sweep(const factors *f, const lanes *values, lanes *x, int columns, int transposed) {
    for (int done = 0; done < f->size;) {
        int j = transposed ? f->size - 1 - done : done;
        int left = transposed ? j + 1 - f->first[j] : f->last[j] - j;
        int wide = left >= AT_ONCE ? AT_ONCE : left >= 2 ? 2 : 1;
        if (transposed) j += 1 - wide;
        if (wide == 4) (transposed ? upper : lower)(f, values, x, j, 4, columns);
        else if (wide == 2) (transposed ? upper : lower)(f, values, x, j, 2, columns);
        else (transposed ? upper : lower)(f, values, x, j, 1, columns);
        done += wide;
    }
}

static void swept(const factors *f, const lanes *values, lanes *x, int columns, int transposed) {
    switch (2 * columns + transposed) {
    case 2: return sweep(f, values, x, 1, 0);
    case 3: return sweep(f, values, x, 1, 1);
    case 4: return sweep(f, values, x, 2, 0);
    case 5: return sweep(f, values, x, 2, 1);
    case 6: return sweep(f, values, x, 3, 0);
    case 7: return sweep(f, values, x, 3, 1);
    case 8: return sweep(f, values, x, 4, 0);
    case 9: return sweep(f, values, x, 4, 1);
    }
}

/* L⁻¹ P v, or Pᵀ L⁻ᵀ v where `transposed`, of vectors (count, size, columns); row j of P v is row
   `order`[j] of v. Returns 2 without memory. */
int solve(const factors *f, const int *order, const double *v, double *result, int columns, int transposed) {
    size_t n = f->size, block = n * columns;
    lanes *x = aligned_alloc(sizeof(lanes), n * AT_ONCE * sizeof(lanes));
    if (!x) return 2;
    for (int b = 0; b < f->batches; b++) {
        int used = f->count - b * LANES < LANES ? f->count - b * LANES : LANES;
        for (int c = 0, some; c < columns; c += some) {
            some = columns - c < AT_ONCE ? columns - c : AT_ONCE;
            memset(x, 0, n * some * sizeof(lanes));
            for (int k = 0; k < used; k++)
                for (size_t j = 0; j < n; j++)
                    for (int i = 0; i < some; i++)
                        x[j * some + i][k] = v[(b * LANES + k) * block + (transposed ? j : order[j]) * columns + c + i];
            swept(f, f->values + b * (size_t)f->start[n], x, some, transposed);
            for (int k = 0; k < used; k++)
                for (size_t j = 0; j < n; j++)
                    for (int i = 0; i < some; i++)
                        result[(b * LANES + k) * block + (transposed ? order[j] : j) * columns + c + i] = x[j * some + i][k];
        }
    }
    free(x);
    return 0;
}
