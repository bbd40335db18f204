/* One pass of the filter through all readings: products of the columns that it leaves white. */

#ifndef PKMCAL_NOISE_PASS_H
#define PKMCAL_NOISE_PASS_H

#include "steps.h"

#define ALONGSIDE 8  /* columns whose products are summed together; their number is a multiple of it */
#define READ 16      /* readings between two sums of products: what is white stays near the processor */

/* How readings were taken, and their noise, for one pass through all of them. */
typedef struct {
    Py_ssize_t T, B, n, ties, k, K;      /* ties: 3 where readings share noise in time, else 0 */
    const long long *reading, *begun;    /* (T, B): which, -1 where none; whether a visit begins */
    const double *seen, *rho, *own, *rows; /* H (T, B, 3, n), (A,), W (A, 3, 3) or none, (A, 3, k) */
    double variance, share, visit;       /* of the noise, the part that goes on, of a visit */
    double *spread;                      /* (T, B, 3) */
    double *P, *x, *block, *sums;        /* (n, n), (n, K), (3 READ, K), (K, K) */
} Pass;

/* Products of `count` rows of K numbers, above the diagonal, onto `sums`. */
INLINE void summed(Py_ssize_t K, Py_ssize_t count, const double *rows, double *sums) {
    for (Py_ssize_t i = 0; i < K; i += 4)
        for (Py_ssize_t j = i - i % ALONGSIDE; j < K; j += ALONGSIDE) {
            lanes sum[4][2] = {{{0.0}}};
            for (Py_ssize_t r = 0; r < count; r++) {
                const double *left = rows + r * K + i;
                const lanes *right = (const lanes *)(rows + r * K + j);
                const lanes first = right[0], second = right[1];
                for (int a = 0; a < 4; a++) sum[a][0] += left[a] * first, sum[a][1] += left[a] * second;
            }
            for (int a = 0; a < 4; a++) {
                lanes *there = (lanes *)(sums + (i + a) * K + j);
                there[0] += sum[a][0], there[1] += sum[a][1];
            }
        }
}

/* One reading: the state's covariance and its columns carried to it, and what is white of them. */
INLINE void taken(const Pass *p, Py_ssize_t at, double *room, double *white_rows) {
    const Py_ssize_t n = p->n, K = p->K, read = p->reading[at];
    double *H = room, *fade = room + 3 * n, *fresh = fade + n, *reach = fresh + n, *gain = reach + 3 * n;
    const double *seen = p->seen + at * 3 * n, *own = p->own ? p->own + 9 * read : NULL;
    const double rho = p->ties ? p->rho[read] : 0.0;
    for (int r = 0; r < 3; r++)
        for (Py_ssize_t i = 0; i < n; i++) {
            double h = seen[r * n + i];
            if (own && i >= p->ties) {
                h = 0.0;
                for (int s = 0; s <= r; s++) h += own[r * 3 + s] * seen[s * n + i];
            }
            H[r * n + i] = h;
        }
    for (Py_ssize_t i = 0; i < n; i++) {
        const int tie = i < p->ties;
        fade[i] = tie ? rho : p->begun[at] ? 0.0 : 1.0;
        fresh[i] = tie ? p->share * p->variance * (1.0 - rho * rho) : p->begun[at] ? p->visit : 0.0;
    }
    double white[9];
    narrowed(n, H, fade, fresh, (1.0 - p->share) * p->variance, p->P, reach, gain, white,
             p->spread + at * 3);
    const double *row = p->rows + read * 3 * p->k;
    double *v = gain + 3 * n;
    for (int r = 0; r < 3; r++) {
        double *mine = v + r * K;
        if (own) {
            for (Py_ssize_t c = 0; c < p->k; c++) mine[c] = own[r * 3] * row[c];
            for (int s = 1; s <= r; s++)
                for (Py_ssize_t c = 0; c < p->k; c++) mine[c] += own[r * 3 + s] * row[s * p->k + c];
        } else
            memcpy(mine, row + r * p->k, (size_t)p->k * sizeof(double));
    }
    for (Py_ssize_t i = 0; i < n; i++) {
        double *x = p->x + i * K;
        for (Py_ssize_t c = 0; c < K; c++) x[c] *= fade[i];
        for (int r = 0; r < 3; r++) {
            const double h = H[r * n + i];
            double *mine = v + r * K;
            if (h != 0.0)
                for (Py_ssize_t c = 0; c < K; c++) mine[c] -= h * x[c];
        }
    }
    for (Py_ssize_t i = 0; i < n; i++) {
        const double a = gain[i * 3], b = gain[i * 3 + 1], g = gain[i * 3 + 2];
        double *x = p->x + i * K;
        for (Py_ssize_t c = 0; c < K; c++) x[c] += a * v[c] + b * v[K + c] + g * v[2 * K + c];
    }
    for (Py_ssize_t c = 0; c < K; c++) {
        const double a = v[c], b = v[K + c], g = v[2 * K + c];
        white_rows[c] = white[0] * a;
        white_rows[K + c] = white[3] * a + white[4] * b;
        white_rows[2 * K + c] = white[6] * a + white[7] * b + white[8] * g;
    }
}

WIDER static void gone_through(const Pass *p, double *room) {
    Py_ssize_t held = 0;
    for (Py_ssize_t b = 0; b < p->B; b++) {
        memset(p->P, 0, (size_t)(p->n * p->n) * sizeof(double));
        memset(p->x, 0, (size_t)(p->n * p->K) * sizeof(double));
        for (Py_ssize_t t = 0, at = b; t < p->T && p->reading[at] >= 0; t++, at += p->B) {
            taken(p, at, room, p->block + held * 3 * p->K);
            if (++held == READ) summed(p->K, 3 * READ, p->block, p->sums), held = 0;
        }
    }
    summed(p->K, 3 * held, p->block, p->sums);
}

#endif
