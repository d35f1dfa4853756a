/* Factors of matrices of one pattern, eight of them side by side: L J Lᵀ = A with a diagonal J of signs,
   every operation one on eight numbers. Columns of L of one pattern below their common triangle are a
   group, which is treated as a dense block; solves take four of its columns at a time. Inverse pivots
   stand in the place of the pivots. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { LANES = 8, AT_ONCE = 4, HIGH = 4 };
typedef double lanes __attribute__((vector_size(LANES * sizeof(double))));

typedef struct {
    int size, entries, count, batches;
    int *start, *rows;  /* columns of L: where they begin (size + 1), and their rising rows */
    int *first, *last;  /* the group of each column: its first column, and the one after its last */
    int *begin, *entry; /* entries of A, column by column, and where columns begin (size + 1) */
    int *place;         /* in L of each of them */
    lanes *values;      /* of L, batch after batch */
} factors;

static int rising(const void *a, const void *b) { return *(const int *)a - *(const int *)b; }

static int *integers(size_t count) { return calloc(count + 1, sizeof(int)); }

/* Sort `count` numbers of which the first `sorted` rise; `spare` has room for the others. */
static void sort_rest(int *numbers, int sorted, int count, int *spare) {
    int rest = count - sorted;
    memcpy(spare, numbers + sorted, rest * sizeof(int));
    qsort(spare, rest, sizeof(int), rising);
    while (rest) numbers[--count] = sorted && numbers[sorted - 1] > spare[rest - 1] ? numbers[--sorted] : spare[--rest];
}

/* Rows of L, column by column: those of A's column and of the columns whose first row below the
   diagonal it is, the last of which mostly has all. */
static int fill_in(factors *f, const int *row) {
    int n = f->size, room = 4 * f->entries + n;
    int *mark = integers(n), *child = integers(n), *next = integers(n), *spare = integers(n);
    f->rows = malloc(room * sizeof(int));
    memset(child, -1, n * sizeof(int)), memset(mark, -1, n * sizeof(int));
    for (int j = 0; j < n && f->rows; j++) {
        int count = f->start[j], sorted = 0;
        if (count + n > room) f->rows = realloc(f->rows, (room = 2 * room + n) * sizeof(int));
        if (!f->rows) break;
        for (int c = child[j]; c >= 0; c = next[c]) {
            for (int k = f->start[c] + 1; k < f->start[c + 1]; k++)
                if (mark[f->rows[k]] != j) mark[f->rows[count++] = f->rows[k]] = j;
            if (c == child[j]) sorted = count - f->start[j];
        }
        for (int k = f->begin[j], r; k < f->begin[j + 1]; k++)
            if (mark[r = row[f->entry[k]]] != j) mark[f->rows[count++] = r] = j;
        sort_rest(f->rows + f->start[j], sorted, count - f->start[j], spare);
        f->start[j + 1] = count;
        if (count - f->start[j] > 1) {
            int parent = f->rows[f->start[j] + 1];
            next[j] = child[parent], child[parent] = j;
        }
    }
    free(mark), free(child), free(next), free(spare);
    return f->rows != NULL;
}

static void sort_entries(factors *f, const int *column) {
    int n = f->size, *next = integers(n);
    for (int e = 0; e < f->entries; e++) f->begin[column[e] + 1]++;
    for (int j = 0; j < n; j++) f->begin[j + 1] += f->begin[j];
    memcpy(next, f->begin, n * sizeof(int));
    for (int e = 0; e < f->entries; e++) f->entry[next[column[e]]++] = e;
    free(next);
}

static void find_places(factors *f, const int *row) {
    int *place = integers(f->size);
    for (int j = 0; j < f->size; j++) {
        for (int k = f->start[j]; k < f->start[j + 1]; k++) place[f->rows[k]] = k;
        for (int k = f->begin[j]; k < f->begin[j + 1]; k++) f->place[k] = place[row[f->entry[k]]];
    }
    free(place);
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
    free(f->start), free(f->rows), free(f->first), free(f->last), free(f->values);
    free(f->begin), free(f->entry), free(f->place), free(f);
}

/* Factors for matrices of entries in the lower triangle, `row` >= `column`, each named once and all
   diagonal ones among them. */
factors *prepare(int size, int entries, const int *row, const int *column) {
    factors *f = calloc(1, sizeof(factors));
    f->size = size, f->entries = entries;
    f->start = integers(size), f->first = integers(size), f->last = integers(size);
    f->begin = integers(size), f->entry = integers(entries), f->place = integers(entries);
    sort_entries(f, column);
    if (!fill_in(f, row)) return discard(f), NULL;
    find_groups(f);
    find_places(f, row);
    return f;
}

#define INLINE static inline __attribute__((always_inline))

/* Take products of `high` rows with two columns from both columns, in rows `p`; `from` are the
   factors, column by column, from the row of the first column on. */
INLINE void block(lanes *one, lanes *two, const int *p, lanes **from, const double *sign, int count, int c, int r,
                  int high) {
    lanes sums[HIGH][2];
    for (int i = 0; i < high; i++) sums[i][0] = sums[i][1] = (lanes){0};
    for (int k = 0; k < count; k++) {
        const lanes *own = from[k];
        lanes a = own[c] * sign[k], b = own[c + 1] * sign[k];
        for (int i = 0; i < high; i++) sums[i][0] += own[r + i] * a, sums[i][1] += own[r + i] * b;
    }
    for (int i = 0; i < high; i++) one[p[r + i]] -= sums[i][0], two[p[r + i]] -= sums[i][1];
}

static void single(lanes *one, const int *p, lanes **from, const double *sign, int count, int c, int r, int rows) {
    for (; r < rows; r++) {
        lanes sum = {0};
        for (int k = 0; k < count; k++) sum += from[k][r] * (from[k][c] * sign[k]);
        one[p[r]] -= sum;
    }
}

/* Take from columns of a group what `count` columns give to them. Both have `rows` rows, of which
   the first `wide` are columns of the group; they stand at `p` in it. */
static void subtract(lanes **column, const int *p, int rows, int wide, lanes **from, const double *sign, int count) {
    int c = 0;
    for (; c + 1 < wide; c += 2) {
        lanes *one = column[p[c]], *two = column[p[c + 1]];
        int r = c + 1;
        single(one, p, from, sign, count, c, c, r);
        for (; r + HIGH <= rows; r += HIGH) block(one, two, p, from, sign, count, c, r, HIGH);
        for (; r < rows; r++) block(one, two, p, from, sign, count, c, r, 1);
    }
    if (c < wide) single(column[p[c]], p, from, sign, count, c, c, rows);
}

/* Factor of `wide` columns of a group, one by one; 0 where a pivot has the wrong sign. */
static int triangle(lanes **column, const double *sign, int first, int wide, int rows) {
    for (int j = first; j < first + wide; j++) {
        lanes *own = column[j], pivot;
        for (int k = first; k < j; k++) {
            lanes factor = column[k][j] * sign[k];
            for (int r = j; r < rows; r++) own[r] -= column[k][r] * factor;
        }
        pivot = own[j] * sign[j];
        for (int k = 0; k < LANES; k++) {
            if (!(pivot[k] > 0)) return 0;
            pivot[k] = 1 / sqrt(pivot[k]);
        }
        own[j] = pivot;
        for (int r = j + 1; r < rows; r++) own[r] *= pivot * sign[j];
    }
    return 1;
}

/* Entries of columns `first` to `last` - 1, of the matrices `own`, into an empty batch. */
static void scatter(const factors *f, lanes *values, const double **own, int first, int last) {
    memset(values + f->start[first], 0, (f->start[last] - f->start[first]) * sizeof(lanes));
    for (int e = f->begin[first]; e < f->begin[last]; e++)
        for (int k = 0; k < LANES; k++) values[f->place[e]][k] = own[k][f->entry[e]];
}

/* One batch of matrices `own`, group by group; 0 where a pivot has the wrong sign. A group that is
   done waits in the list of the next row that it gives to. */
static int eliminate(const factors *f, lanes *values, const double **own, const double *sign, int *list,
                     lanes **column) {
    lanes **from = column + f->size;
    int n = f->size, *waiting = list, *next = list + n, *given = list + 2 * n;
    int *place = list + 3 * n, *p = list + 4 * n;
    memset(waiting, -1, n * sizeof(int));
    for (int first = 0, last; first < n; first = last) {
        last = f->last[first];
        int wide = last - first, begin = f->start[first], rows = f->start[first + 1] - begin;
        const int *row = f->rows + begin;
        scatter(f, values, own, first, last);
        for (int k = 0; k < wide; k++) column[k] = values + f->start[first + k] - k;
        for (int r = 0; r < rows; r++) place[row[r]] = r;
        for (int j = first; j < last; j++)
            for (int g = waiting[j], after; g >= 0; g = after) {
                int end = f->last[g], at = given[g], columns = 0;
                int left = f->start[end] - f->start[end - 1] - 1 - at;
                const int *below = f->rows + f->start[end - 1] + 1 + at;
                after = next[g];
                for (int r = 0; r < left; r++) p[r] = place[below[r]], columns += below[r] < last;
                for (int k = g; k < end; k++) from[k - g] = values + f->start[k] + end - k + at;
                subtract(column, p, left, columns, from, sign + g, end - g);
                given[g] += columns;
                if (columns < left) next[g] = waiting[below[columns]], waiting[below[columns]] = g;
            }
        for (int k = 0, some; k < wide; k += some) {
            some = wide - k < AT_ONCE ? wide - k : AT_ONCE;
            for (int r = 0; r < rows - k; r++) p[r] = k + r;
            for (int i = 0; i < k; i++) from[i] = column[i] + k;
            subtract(column, p, rows - k, some, from, sign + first, k);
            if (!triangle(column, sign + first, k, some, rows)) return 0;
        }
        if (wide < rows) given[first] = 0, next[first] = waiting[row[wide]], waiting[row[wide]] = first;
    }
    return 1;
}

/* Factors of `count` matrices, `entries` of each, with pivots of given signs; 0, 1 where one has another,
   2 without memory. */
int factorise(factors *f, int count, const double *entries, const double *sign) {
    size_t n = f->size, length = f->start[n];
    f->count = count, f->batches = (count + LANES - 1) / LANES;
    free(f->values);
    f->values = aligned_alloc(sizeof(lanes), f->batches * length * sizeof(lanes));
    lanes **pointers = malloc(2 * n * sizeof(lanes *));
    int *list = integers(5 * n), status = f->values && pointers && list ? 0 : 2;
    for (int b = 0; b < f->batches && !status; b++) {
        const double *own[LANES];
        for (int k = 0; k < LANES; k++) {
            int one = b * LANES + k < count ? b * LANES + k : count - 1;
            own[k] = entries + (size_t)one * f->entries;
        }
        status = !eliminate(f, f->values + b * length, own, sign, list, pointers);
    }
    free(pointers), free(list);
    return status;
}

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
