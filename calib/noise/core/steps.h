/* The step of the covariance of a Kalman filter, for one reading of three components. */

#ifndef PKMCAL_NOISE_STEPS_H
#define PKMCAL_NOISE_STEPS_H

#include <Python.h>
#include <math.h>
#include <string.h>

/* Wider registers where the processor has them; without contraction the results are the same. */
#if defined(__GNUC__) && !defined(__clang__) && defined(__x86_64__) && defined(__gnu_linux__)
#define WIDER __attribute__((target_clones("avx2", "default")))
#else
#define WIDER
#endif
typedef double lanes __attribute__((vector_size(32), aligned(8), may_alias));
#define INLINE static inline __attribute__((always_inline))
#define BLOCK 64 /* columns that are carried along together: their states stay near the processor */

/* S = L L^T: L^-1 and the diagonal of L. */
INLINE void inverted_root(const double *S, double *white, double *spread) {
    const double a = sqrt(S[0]), b = S[3] / a, c = S[6] / a;
    const double d = sqrt(S[4] - b * b), e = (S[7] - c * b) / d, f = sqrt(S[8] - c * c - e * e);
    memset(white, 0, 9 * sizeof(double));
    white[0] = 1.0 / a, white[4] = 1.0 / d, white[8] = 1.0 / f;
    white[3] = -b * white[0] * white[4];
    white[7] = -e * white[4] * white[8];
    white[6] = -(c * white[0] + e * white[3]) * white[8];
    spread[0] = a, spread[1] = d, spread[2] = f;
}

/* One step of the covariance P (n, n): faded, widened, and narrowed by a reading. */
INLINE void narrowed(Py_ssize_t n, const double *seen, const double *fade, const double *fresh,
                     double noise, double *P, double *reach, double *gain, double *white,
                     double *spread) {
    for (Py_ssize_t i = 0; i < n; i++) {
        for (Py_ssize_t j = 0; j < n; j++) P[i * n + j] *= fade[i] * fade[j];
        P[i * n + i] += fresh[i];
    }
    double total[9];
    for (Py_ssize_t i = 0; i < n; i++)
        for (int r = 0; r < 3; r++) {
            double sum = 0.0;
            for (Py_ssize_t j = 0; j < n; j++) sum += P[i * n + j] * seen[r * n + j];
            reach[i * 3 + r] = sum;
        }
    for (int r = 0; r < 3; r++)
        for (int s = 0; s < 3; s++) {
            double sum = r == s ? noise : 0.0;
            for (Py_ssize_t i = 0; i < n; i++) sum += seen[r * n + i] * reach[i * 3 + s];
            total[r * 3 + s] = sum;
        }
    inverted_root(total, white, spread);
    for (Py_ssize_t i = 0; i < n; i++) {
        double half[3];
        for (int r = 0; r < 3; r++) {
            half[r] = 0.0;
            for (int s = 0; s <= r; s++) half[r] += white[r * 3 + s] * reach[i * 3 + s];
        }
        for (int r = 0; r < 3; r++) {
            gain[i * 3 + r] = 0.0;
            for (int s = r; s < 3; s++) gain[i * 3 + r] += white[s * 3 + r] * half[s];
        }
    }
    for (Py_ssize_t i = 0; i < n; i++)
        for (Py_ssize_t j = 0; j <= i; j++) {
            double less = 0.0;
            for (int r = 0; r < 3; r++)
                less += 0.5 * (gain[i * 3 + r] * reach[j * 3 + r] + gain[j * 3 + r] * reach[i * 3 + r]);
            P[j * n + i] = P[i * n + j] = P[i * n + j] - less;
        }
}

#endif
