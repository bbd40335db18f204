/* Orthogonal factorisation of small matrices, LANES at once; as calib/mechanism/householder.py.

   A (m, n) is column after column. After `factorise` the reflectors stand in and below its
   diagonal and R strictly above; R's diagonal, its inverse and the reflectors' factors apart. */

#ifndef PKMCAL_HOUSEHOLDER_H
#define PKMCAL_HOUSEHOLDER_H

#include "lanes.h"

typedef struct { vec *A, *factor, *diagonal, *inverse; } Reflectors;

INLINE void reflect(vec *b, const vec *v, vec factor, int m) {
    const vec along = dot(v, b, m) * factor;
    UNROLL for (int i = 0; i < m; i++) b[i] -= v[i] * along;
}

INLINE void factorise(const Reflectors *q, int m, int n) {
    const vec zero = splat(0.0), one = splat(1.0);
    UNROLL for (int k = 0; k < n; k++) {
        vec *v = q->A + k * m + k;
        const vec square = dot(v, v, m - k);
        const vec norm = root(square);
        const vec signed_norm = SELECT(v[0] < zero, -norm, norm);
        const vec denominator = square + signed_norm * v[0];
        const mask tiny = denominator <= zero;
        v[0] += signed_norm;
        q->factor[k] = SELECT(tiny, zero, one / SELECT(tiny, one, denominator));
        q->diagonal[k] = -signed_norm;
        q->inverse[k] = one / q->diagonal[k];
        UNROLL for (int j = k + 1; j < n; j++) reflect(q->A + j * m + k, v, q->factor[k], m - k);
    }
}

INLINE void apply_transposed(const Reflectors *q, vec *b, int m, int n) {
    UNROLL for (int k = 0; k < n; k++) reflect(b + k, q->A + k * m + k, q->factor[k], m - k);
}

INLINE void apply(const Reflectors *q, vec *b, int m, int n) {
    UNROLL for (int k = n - 1; k >= 0; k--) reflect(b + k, q->A + k * m + k, q->factor[k], m - k);
}

/* R^-1 b for the leading n rows of b, in place. */
INLINE void solve_triangle(const Reflectors *q, vec *b, int m, int n) {
    UNROLL for (int k = n - 1; k >= 0; k--) {
        UNROLL for (int j = k + 1; j < n; j++) b[k] -= q->A[j * m + k] * b[j];
        b[k] *= q->inverse[k];
    }
}

/* Smallest over largest magnitude on the diagonal of R; not a number where one is none. */
INLINE vec diagonal_ratio(const Reflectors *q, int n) {
    vec least = magnitude(q->diagonal[0]), most = least, sum = least;
    for (int k = 1; k < n; k++) {
        const vec d = magnitude(q->diagonal[k]);
        least = smaller(d, least);
        most = larger(d, most);
        sum += d;
    }
    return SELECT(is_finite(sum), least / most, splat(NAN));
}

#endif
