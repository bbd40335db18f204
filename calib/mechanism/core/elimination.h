/* Six equations of a limb, solved by elimination, LANES at once.

   Which equation gives which unknown is chosen once, in the first lane, by the largest of what is
   left; a pivot that is small elsewhere is told, and somebody else solves it. Half the work of the
   reflections of householder.h, and fewer steps that wait for one another. */

#ifndef PKMCAL_ELIMINATION_H
#define PKMCAL_ELIMINATION_H

#include "lanes.h"

#define LEAST_PIVOT 0.01 /* of columns whose numbers are about one */

typedef struct {
    int known, row[6], column[6]; /* where row and column stand; the last column stands last */
    vec A[36], inverse[6];        /* column after column: multipliers below, the rest above */
} Elimination;

/* Complete pivoting of six columns; the last column is the last unknown. */
static void choose_order(Elimination *e, const double column[6][6]) {
    double left[6][6];
    int rows[6], columns[6];
    for (int c = 0; c < 6; c++) {
        rows[c] = columns[c] = c;
        for (int r = 0; r < 6; r++) left[c][r] = column[c][r];
    }
    for (int k = 0; k < 6; k++) {
        int r = k, c = k;
        for (int j = k; j < (k < 5 ? 5 : 6); j++)
            for (int i = k; i < 6; i++)
                if (fabs(left[columns[j]][rows[i]]) > fabs(left[columns[c]][rows[r]])) r = i, c = j;
        const int row = rows[r], own = columns[c];
        rows[r] = rows[k];
        columns[c] = columns[k];
        rows[k] = row;
        columns[k] = own;
        e->row[row] = e->column[own] = k;
        for (int j = k + 1; j < 6; j++) {
            const double factor = left[columns[j]][row] / left[own][row];
            for (int i = k + 1; i < 6; i++)
                left[columns[j]][rows[i]] -= factor * left[own][rows[i]];
        }
    }
    e->known = 1;
}

/* Lanes in which every pivot is large enough. */
INLINE mask eliminate(Elimination *e) {
    vec *A = e->A, least = magnitude(A[0]);
    UNROLL for (int k = 0; k < 6; k++) {
        least = smaller(magnitude(A[7 * k]), least);
        e->inverse[k] = 1.0 / A[7 * k];
        UNROLL for (int r = k + 1; r < 6; r++) A[6 * k + r] *= e->inverse[k];
        UNROLL for (int c = k + 1; c < 6; c++) {
            UNROLL for (int r = k + 1; r < 6; r++) A[6 * c + r] -= A[6 * k + r] * A[6 * c + k];
        }
    }
    return least > splat(LEAST_PIVOT);
}

/* Unknowns x (6) for right-hand sides b (6). */
INLINE void solve_eliminated(const Elimination *e, const vec *b, vec *x) {
    const vec *A = e->A;
    vec y[6];
    for (int i = 0; i < 6; i++) y[e->row[i]] = b[i];
    UNROLL for (int k = 0; k < 6; k++) {
        UNROLL for (int r = k + 1; r < 6; r++) y[r] -= A[6 * k + r] * y[k];
    }
    UNROLL for (int k = 5; k >= 0; k--) {
        y[k] *= e->inverse[k];
        UNROLL for (int r = 0; r < k; r++) y[r] -= A[6 * k + r] * y[k];
    }
    for (int c = 0; c < 6; c++) x[c] = y[e->column[c]];
}

/* The unit vector (6) across the first five columns. */
INLINE void across(const Elimination *e, vec *out) {
    const vec *A = e->A;
    vec z[6];
    z[5] = splat(1.0);
    UNROLL for (int k = 4; k >= 0; k--) {
        z[k] = splat(0.0);
        UNROLL for (int r = k + 1; r < 6; r++) z[k] -= A[6 * k + r] * z[r];
    }
    const vec scale = 1.0 / root(dot(z, z, 6));
    for (int i = 0; i < 6; i++) out[i] = z[e->row[i]] * scale;
}

#endif
