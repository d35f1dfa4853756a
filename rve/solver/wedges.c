/* Sums over wedges: which unknowns share one, and the matrix of one phase. Unknowns count in pairs, a
   pair for each node of a wedge, -1 where it is fixed. */
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

enum { NODES = 15, SLICES = 3, CORNERS = 6, PLANAR = 12, LOADS = 3 };

typedef void (*integral)(double *, const double *, const double *, const double *, const int *,
                         const uint8_t *, void *);

/* Pairs that share a wedge with each of the pairs `low` to `high`, rising: those in that range, counted
   from `low`, and the others; and where each row's begin among either (high - low + 1). `place` takes where the pairs of each wedge then stand, 15 x 15 of them: n
   as the one of number n of those rows whose column lies in that range too, -2 - n among the others, -1
   where the row is another's or one of them is fixed. Returns 2 without memory. */
int couple(int wedges, const int *pairs, int low, int high, int size, int *inner_starts, int *inner,
           int *outer_starts, int *outer, int *place) {
    int rows = high - low, words = size / 64 + 1, entries = wedges * NODES;
    int *begin = calloc(rows + 1, sizeof(int)), *fill = calloc(rows + 1, sizeof(int));
    int *within = malloc((entries + 1) * sizeof(int)), *found = calloc(size + 1, sizeof(int));
    uint64_t *marked = calloc(words, sizeof(uint64_t));
    int status = begin && fill && within && found && marked ? 0 : 2, square = 0, others = 0;
    for (size_t e = 0; e < (size_t)entries * NODES; e++) place[e] = -1;
    for (int e = 0; e < entries && !status; e++)
        if (pairs[e] >= low && pairs[e] < high) begin[pairs[e] - low + 1]++;
    for (int r = 0; r < rows && !status; r++) fill[r] = begin[r + 1] += begin[r];
    for (int e = entries - 1; e >= 0 && !status; e--)
        if (pairs[e] >= low && pairs[e] < high) within[--fill[pairs[e] - low]] = e;
    inner_starts[0] = outer_starts[0] = 0;
    for (int r = 0; r < rows && !status; r++) {
        int least = words, last = -1;
        for (int k = begin[r]; k < begin[r + 1]; k++)
            for (int j = 0, *own = (int *)pairs + within[k] / NODES * NODES; j < NODES; j++)
                if (own[j] >= 0) {
                    int word = own[j] / 64;
                    marked[word] |= (uint64_t)1 << own[j] % 64;
                    if (word < least) least = word;
                    if (word > last) last = word;
                }
        for (int word = least; word <= last; word++)
            for (; marked[word]; marked[word] &= marked[word] - 1) {
                int column = 64 * word + __builtin_ctzll(marked[word]);
                if (column >= low && column < high) found[column] = square, inner[square++] = column - low;
                else found[column] = -2 - others, outer[others++] = column;
            }
        inner_starts[r + 1] = square, outer_starts[r + 1] = others;
        for (int k = begin[r]; k < begin[r + 1]; k++)
            for (int j = 0, *own = (int *)pairs + within[k] / NODES * NODES; j < NODES; j++)
                place[(size_t)within[k] * NODES + j] = own[j] >= 0 ? found[own[j]] : -1;
    }
    free(begin), free(fill), free(within), free(found), free(marked);
    return status;
}

/* Nodes of a wedge below and above each corner of a triangle of six nodes, and half-way at its vertices: in
   that order they are its HATS and BUBBLES. The corners after the vertices lie between two of those. */
enum { HATS = 2 * PLANAR, BUBBLES = CORNERS, DOFS = HATS + BUBBLES };
static const int ORDER[NODES] = {0, 1, 2, 9, 7, 6, 3, 4, 5, 14, 13, 12, 8, 10, 11}, ENDS[3][2] = {{1, 2}, {0, 2}, {0, 1}};

/* Places of the nodes in ORDER, from those in the wedge's own, and displacements under unit strains. */
static void arrange(const double *nodes, double (*places)[2], double (*affine)[DOFS]) {
    for (int k = 0; k < NODES; k++) {
        double x = nodes[3 * ORDER[k]], y = nodes[3 * ORDER[k] + 1], u = x - nodes[0], v = y - nodes[1];
        places[k][0] = x, places[k][1] = y;
        affine[0][2 * k] = u, affine[0][2 * k + 1] = affine[1][2 * k] = 0, affine[1][2 * k + 1] = v;
        affine[2][2 * k] = v / 2, affine[2][2 * k + 1] = u / 2;
    }
}

/* Corners of a slice of constant theta; `along` has the hats from below and above and the bubble there. */
static void cut(const double *along, const double (*places)[2], double (*corners)[3]) {
    for (int d = 0; d < 2; d++) {
        double bubble[3];
        for (int v = 0; v < 3; v++)
            bubble[v] = places[2 * CORNERS + v][d] - (places[v][d] + places[CORNERS + v][d]) / 2;
        for (int c = 0; c < CORNERS; c++) {
            double rise = c < 3 ? bubble[c] : (bubble[ENDS[c - 3][0]] + bubble[ENDS[c - 3][1]]) / 2;
            corners[c][d] = along[0] * places[c][d] + along[1] * places[CORNERS + c][d] + along[2] * rise;
        }
    }
}

/* A column for each displacement of the vertices, from those of the corners: what their bubbles carry. */
static void carried(int rows, const double (*corners)[PLANAR], double (*found)[BUBBLES]) {
    for (int r = 0; r < rows; r++) {
        for (int c = 0; c < BUBBLES; c++) found[r][c] = corners[r][c];
        for (int e = 0; e < 3; e++)
            for (int k = 0; k < 2; k++)
                for (int d = 0; d < 2; d++) found[r][2 * ENDS[e][k] + d] += corners[r][2 * (e + 3) + d] / 2;
    }
}

/* Matrix of a wedge, its nodes in ORDER: the sum of its slices of constant theta, triangles of six nodes
   whose displacements are hats times those below and above, and bubbles on the vertices. */
static void wedge(integral integrate, const double *weights, const double (*places)[2], const double *constants,
                  const double (*along)[3], const double *heights, double (*matrix)[DOFS]) {
    double sums[6][PLANAR][PLANAR] = {{{0}}}, beside[2][PLANAR][BUBBLES], half[PLANAR][BUBBLES];
    double turned[BUBBLES][PLANAR], own[BUBBLES][BUBBLES];
    for (int s = 0; s < SLICES; s++, weights += CORNERS) {
        double corners[CORNERS][3] = {{0}}, planar[PLANAR][PLANAR] = {{0}};
        cut(along[s], places, corners);
        integrate(planar[0], weights, constants, corners[0], NULL, NULL, NULL);
        for (int i = 0, k = 0; i < 3; i++)
            for (int j = 0; j <= i; j++, k++) {
                double factor = heights[s] * along[s][i] * along[s][j];
                for (int e = 0; e < PLANAR * PLANAR; e++) sums[k][0][e] += factor * planar[0][e];
            }
    }
    carried(PLANAR, sums[3], beside[0]), carried(PLANAR, sums[4], beside[1]), carried(PLANAR, sums[5], half);
    for (int r = 0; r < PLANAR; r++)
        for (int c = 0; c < BUBBLES; c++) turned[c][r] = half[r][c];
    carried(BUBBLES, turned, own);
    for (int i = 0; i < 2; i++)
        for (int r = 0; r < PLANAR; r++) {
            for (int j = 0; j < 2; j++)
                memcpy(matrix[i * PLANAR + r] + j * PLANAR, sums[i + j][r], sizeof sums[0][r]);
            for (int c = 0; c < BUBBLES; c++)
                matrix[i * PLANAR + r][HATS + c] = matrix[HATS + c][i * PLANAR + r] = beside[i][r][c];
        }
    for (int r = 0; r < BUBBLES; r++) memcpy(matrix[HATS + r] + HATS, own[r], sizeof own[r]);
    /* a bubble is what is half-way less the mean of what is below and above */
    for (int r = 0; r < DOFS; r++)
        for (int c = 0; c < BUBBLES; c++)
            for (int i = 0; i < 2; i++) matrix[r][i * PLANAR + c] -= matrix[r][HATS + c] / 2;
    for (int r = 0; r < BUBBLES; r++)
        for (int i = 0; i < 2; i++)
            for (int c = 0; c < DOFS; c++) matrix[i * PLANAR + r][c] -= matrix[HATS + r][c] / 2;
}

/* Add the matrices of some wedges, and take from `forces` (pairs x 2 x 3) what they do to unit strains.

   integrate: over a triangle at one theta; weights: at its 6 points in 3 slices, for each of the wedges.
   some: numbers of the wedges; nodes, pairs, place: of all wedges, 15 x 3, 15 and 15 x 15; pairs count
   from the first of the rows, -1 where they are none of them. The third coordinate of nodes is theta.
   along, heights: hats from below and above and bubble of each slice, 3 x 3, and its weight for unit height, 3.
   values, others: blocks of 2 x 2, column by column, where `place` is not negative, and below -1. */
void add_wedges(integral integrate, const double (*along)[3], const double *heights, int count, const int *some,
                const double *weights, const double *nodes, const double *constants, const int *pairs,
                const int *place, double *values, double *others, double *forces) {
    double matrix[DOFS][DOFS], affine[LOADS][DOFS], places[NODES][2], high[SLICES];
    for (int k = 0; k < count; k++) {
        const double *corners = nodes + (size_t)some[k] * NODES * 3;
        const int *own = pairs + (size_t)some[k] * NODES, *at = place + (size_t)some[k] * NODES * NODES;
        for (int s = 0; s < SLICES; s++) high[s] = heights[s] * (corners[3 * 3 + 2] - corners[2]);
        for (int e = 0; e < NODES * NODES; e++) /* which are fetched while the matrix is made */
            if (at[e] >= 0) __builtin_prefetch(values + 4 * (size_t)at[e], 1);
        arrange(corners, places, affine);
        wedge(integrate, weights + (size_t)k * SLICES * CORNERS, places, constants, along, high, matrix);
        for (int i = 0; i < NODES; i++)
            for (int j = 0; j < NODES; j++) {
                int to = at[ORDER[i] * NODES + ORDER[j]];
                if (to == -1) continue;
                double *block = to >= 0 ? values + 4 * (size_t)to : others + 4 * (size_t)(-2 - to);
                block[0] += matrix[2 * i][2 * j], block[1] += matrix[2 * i + 1][2 * j];
                block[2] += matrix[2 * i][2 * j + 1], block[3] += matrix[2 * i + 1][2 * j + 1];
            }
        double sum[LOADS][DOFS] = {{0}};
        for (int j = 0; j < DOFS; j++)
            for (int l = 0; l < LOADS; l++)
                for (int i = 0; i < DOFS; i++) sum[l][i] += affine[l][j] * matrix[j][i];
        for (int i = 0; i < DOFS; i++) {
            int row = own[ORDER[i / 2]];
            for (int l = 0; l < LOADS && row >= 0; l++) forces[(2 * row + i % 2) * LOADS + l] -= sum[l][i];
        }
    }
}

/* Add products of some rows of blocks, 2 x 2 and column by column, with vectors side by side.

   some, starts, columns: numbers of the `count` rows, where each one's blocks begin, and their columns.
   from, to: two rows for each number, `step` numbers from one row to the next, `loads` vectors in each. */
void add_products(int count, const int *some, const int *starts, const int *columns, const double *blocks,
                  int loads, int step, const double *from, double *to) {
    for (int r = 0; r < count; r++) {
        double sum[2][loads + 1], *row = to + 2 * (size_t)step * some[r];
        memset(sum, 0, sizeof sum);
        for (int e = starts[r]; e < starts[r + 1]; e++) {
            const double *block = blocks + 4 * (size_t)e, *x = from + 2 * (size_t)step * columns[e];
            for (int l = 0; l < loads; l++) {
                sum[0][l] += block[0] * x[l] + block[2] * x[step + l];
                sum[1][l] += block[1] * x[l] + block[3] * x[step + l];
            }
        }
        for (int l = 0; l < loads; l++) row[l] += sum[0][l], row[step + l] += sum[1][l];
    }
}

/* As `strains`, for a number of displacements that the compiler knows where it is a usual one. */
static inline __attribute__((always_inline)) void
strains_of(int loads, int wedges, int points, const double (*table)[2][NODES], const double *positions,
           const double *displacements, double *found, double *determinants) {
    int wide = 2 * loads;
    double slopes[2][wide + 1];
    for (int m = 0; m < wedges; m++, positions += 3 * NODES, displacements += NODES * wide)
        for (int q = 0; q < points; q++, found += 3 * loads) {
            double along[2][2] = {{0}};
            for (int c = 0; c < wide; c++) slopes[0][c] = slopes[1][c] = 0;
            for (int j = 0; j < NODES; j++) {
                double x = table[q][0][j], y = table[q][1][j];
                for (int d = 0; d < 2; d++) {
                    along[0][d] += x * positions[3 * j + d];
                    along[1][d] += y * positions[3 * j + d];
                }
                for (int c = 0; c < wide; c++) {
                    slopes[0][c] += x * displacements[j * wide + c];
                    slopes[1][c] += y * displacements[j * wide + c];
                }
            }
            double determinant = along[0][0] * along[1][1] - along[0][1] * along[1][0];
            double a = along[0][0] / determinant, b = along[0][1] / determinant;
            double c = along[1][0] / determinant, d = along[1][1] / determinant;
            *determinants++ = determinant;
            for (int l = 0, k = loads; l < loads; l++, k++) {
                found[l] = d * slopes[0][l] - b * slopes[1][l];
                found[loads + l] = a * slopes[1][k] - c * slopes[0][k];
                found[2 * loads + l] = d * slopes[0][k] - b * slopes[1][k] + a * slopes[1][l] - c * slopes[0][l];
            }
        }
}

/* Strains (e11, e22, 2 e12) at fixed theta, of `loads` displacements, at `points` of each wedge, and the
   determinants of the planar Jacobian there.

   table: derivatives of the shape functions in the plane, points x 2 x 15.
   positions, displacements: of the wedges' nodes, 15 x 3 and 15 x 2 x loads for each. */
void strains(int wedges, int points, int loads, const double (*table)[2][NODES], const double *positions,
             const double *displacements, double *found, double *determinants) {
    switch (loads) {
    case 0: return strains_of(0, wedges, points, table, positions, displacements, found, determinants);
    case 2: return strains_of(2, wedges, points, table, positions, displacements, found, determinants);
    case 3: return strains_of(3, wedges, points, table, positions, displacements, found, determinants);
    case 6: return strains_of(6, wedges, points, table, positions, displacements, found, determinants);
    default: return strains_of(loads, wedges, points, table, positions, displacements, found, determinants);
    }
}

/* Stiffness matrices, 12 x 12 each, of triangles of six nodes: `table` has the derivatives of the shape
   functions at three points of equal weight, 3 x 2 x 6; positions, moduli: 6 x 2 and 3 x 3 for each. */
void triangle_stiffness(int triangles, const double (*table)[2][CORNERS], const double *positions,
                        const double (*moduli)[3][3], double (*found)[PLANAR][PLANAR]) {
    for (int m = 0; m < triangles; m++, positions += 2 * CORNERS) {
        memset(found[m], 0, sizeof found[m]);
        for (int q = 0; q < SLICES; q++) {
            double along[2][2] = {{0}}, strain[3][PLANAR] = {{0}}, stress[3][PLANAR] = {{0}};
            for (int k = 0; k < 2; k++)
                for (int j = 0; j < CORNERS; j++)
                    for (int d = 0; d < 2; d++) along[k][d] += table[q][k][j] * positions[2 * j + d];
            double determinant = along[0][0] * along[1][1] - along[0][1] * along[1][0];
            for (int j = 0; j < CORNERS; j++) {
                double u = table[q][0][j] / determinant, v = table[q][1][j] / determinant;
                strain[0][2 * j] = strain[2][2 * j + 1] = along[1][1] * u - along[0][1] * v;
                strain[1][2 * j + 1] = strain[2][2 * j] = along[0][0] * v - along[1][0] * u;
            }
            for (int i = 0; i < 3; i++)
                for (int k = 0; k < 3; k++) {
                    double factor = moduli[m][i][k] * determinant / 6;
                    for (int j = 0; j < PLANAR; j++) stress[i][j] += factor * strain[k][j];
                }
            for (int k = 0; k < 3; k++)
                for (int i = 0; i < PLANAR; i++)
                    for (int j = 0; j < PLANAR; j++) found[m][i][j] += strain[k][i] * stress[k][j];
        }
    }
}

/* Lower triangle of a matrix to which triangles add, column by column: rows and columns of its entries, and
   the entries of the triangles, k x k each, that make them: those of number n are `kept` from starts[n] on.
   unknowns: k of each triangle, -1 where there is none. Returns how many entries it has, -1 without memory. */
int lower_triangle(int triangles, int k, int size, const int *unknowns, int *kept, int *starts, int *rows,
                   int *columns) {
    int count = triangles * k * k, total = 0;
    int *begin = calloc(size + 2, sizeof(int)), *mark = malloc((size + 1) * sizeof(int));
    int *place = malloc((size + 1) * sizeof(int)), *sorted = malloc((count + 1) * sizeof(int));
    int enough = begin && mark && place && sorted;
    for (int pass = 0; pass < 2 && enough; pass++) {
        for (int e = 0; e < count; e++) {
            int row = unknowns[e / k], column = unknowns[e / k / k * k + e % k];
            if (column < 0 || row < column) continue;
            if (pass) kept[begin[column + 1]++] = e;
            else begin[column + 2]++;
        }
        for (int c = 0; c < size && !pass; c++) begin[c + 2] += begin[c + 1];
    }
    if (enough) memset(mark, -1, (size + 1) * sizeof(int));
    starts[0] = 0;
    for (int c = 0, first = 0, last; c < size && enough; c++, first = last) {
        int found = total;
        last = begin[c + 1];
        for (int e = first; e < last; e++) {
            int row = unknowns[kept[e] / k];
            if (mark[row] != c) {
                int at = found++;
                for (; at > total && rows[at - 1] > row; at--) rows[at] = rows[at - 1];
                rows[at] = row, mark[row] = c, place[row] = 0;
            }
            place[row]++;
        }
        for (; total < found; total++) {
            int row = rows[total], here = starts[total];
            columns[total] = c, starts[total + 1] = here + place[row], place[row] = here;
        }
        for (int e = first; e < last; e++) sorted[place[unknowns[kept[e] / k]]++] = kept[e];
        memcpy(kept + first, sorted + first, (last - first) * sizeof(int));
    }
    free(begin), free(mark), free(place), free(sorted);
    return enough ? total : -1;
}

/* Entries of such a matrix from those of the triangles, `size` of each, times the triangle's scale. */
void gather(int count, const int *kept, const int *starts, int size, const double *scales, const double *elements,
            double *values) {
    for (int n = 0; n < count; n++) {
        double sum = 0;
        for (int e = starts[n]; e < starts[n + 1]; e++) sum += scales[kept[e] / size] * elements[kept[e]];
        values[n] = sum;
    }
}

/* Matrices, 2 k x 2 k each, of triangles of k nodes that stand at `places`, three coordinates each; constants
   are those of the phase that a triangle is `inside`. */
void integrate_triangles(integral integrate, int triangles, int k, const double *places,
                         const double (*constants)[3], const uint8_t *inside, double *found) {
    memset(found, 0, (size_t)triangles * 4 * k * k * sizeof(double));
    for (int m = 0; m < triangles; m++, places += 3 * k, found += 4 * k * k)
        integrate(found, NULL, constants[inside[m]], places, NULL, NULL, NULL);
}

/* Add a symmetric matrix, given by its lower triangle, times `width` vectors side by side to `found`. */
void add_symmetric(int count, const int *rows, const int *columns, const double *values, int width,
                   const double *vectors, double *found) {
    for (int n = 0; n < count; n++) {
        long row = (long)rows[n] * width, column = (long)columns[n] * width;
        for (int i = 0; i < width; i++) found[row + i] += values[n] * vectors[column + i];
        if (row == column) continue;
        for (int i = 0; i < width; i++) found[column + i] += values[n] * vectors[row + i];
    }
}

/* Add to `count` vectors on all nodes of a plane, `width` numbers a node, linear functions that have values on
   its corners: a node that follows the corners lies half-way between its two `ends`, of which -1 is fixed.
   Where `back`, add the transposed of that to the corners instead. */
void inject(int count, int corners, int middles, int width, const int (*ends)[2], double *nodes, double *values,
            int back) {
    long all = (long)(corners + middles) * width, some = (long)corners * width;
    for (int k = 0; k < count; k++, nodes += all, values += some) {
        for (long i = 0; i < some; i++)
            if (back) values[i] += nodes[i];
            else nodes[i] += values[i];
        for (int m = 0; m < 2 * middles; m++) {
            int end = ends[m / 2][m % 2];
            double *middle = nodes + some + (long)(m / 2) * width, *value = values + (long)end * width;
            for (int i = 0; i < width && end >= 0; i++)
                if (back) value[i] += middle[i] / 2;
                else middle[i] += value[i] / 2;
        }
    }
}
