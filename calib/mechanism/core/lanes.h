/* Several poses at once: a vec holds one number of LANES poses, a mask one truth of each.

   With GCC and Clang these are vector extensions, lowered to whatever the processor has; other
   compilers get one lane. No function here depends on fast-math: not a number stays what it is. */

#ifndef PKMCAL_LANES_H
#define PKMCAL_LANES_H

#include <math.h>
#include <stdint.h>
#include <string.h>

#if defined(__GNUC__)
#ifndef LANES
#define LANES 2
#endif
#define INLINE static inline __attribute__((always_inline))
#define COLD __attribute__((noinline, cold))
#define UNROLL _Pragma("GCC unroll 8")
typedef double vec __attribute__((vector_size(8 * LANES)));
typedef int64_t mask __attribute__((vector_size(8 * LANES)));
#define LANE(v, l) ((v)[l])
#define NOT(m) (~(m))
#define SELECT(m, a, b) ((vec)(((mask)(a) & (m)) | ((mask)(b) & ~(m))))
#define BITS(v) ((mask)(v))
#define FROM_BITS(m) ((vec)(m))
#define ANY(m) any_lane(m)
INLINE int any_lane(mask m) { /* all bits of a lane, or none */
#if defined(__AVX__) && LANES == 4
    return __builtin_ia32_movmskpd256(FROM_BITS(m)) != 0;
#elif defined(__SSE2__) && LANES == 2
    return __builtin_ia32_movmskpd(FROM_BITS(m)) != 0;
#endif
    int64_t any = 0;
    for (int l = 0; l < LANES; l++) any |= m[l];
    return any != 0;
}
#else
#define LANES 1
#define INLINE static __inline
#define COLD
#define UNROLL
typedef double vec;
typedef int64_t mask;
#define LANE(v, l) (v)
#define NOT(m) (!(m))
#define SELECT(m, a, b) ((m) ? (a) : (b))
#define ANY(m) ((m) != 0)
INLINE mask BITS(double v) { mask m; memcpy(&m, &v, 8); return m; }
INLINE vec FROM_BITS(mask m) { vec v; memcpy(&v, &m, 8); return v; }
#endif

#define ALL(m) (!ANY(NOT(m)))

INLINE vec splat(double x) {
    vec v;
    for (int l = 0; l < LANES; l++) LANE(v, l) = x;
    return v;
}

INLINE vec magnitude(vec v) { return FROM_BITS(BITS(v) & INT64_MAX); }
INLINE vec larger(vec a, vec b) { return SELECT(a > b, a, b); }
INLINE vec smaller(vec a, vec b) { return SELECT(a < b, a, b); }
INLINE mask is_finite(vec v) { return (v - v) == splat(0.0); }

/* In two sums, so that neither waits for the other. */
INLINE vec dot(const vec *a, const vec *b, int n) {
    vec even = a[0] * b[0], odd = splat(0.0);
    UNROLL for (int i = 1; i < n; i++) {
        if (i % 2) odd += a[i] * b[i];
        else even += a[i] * b[i];
    }
    return even + odd;
}

INLINE vec root(vec v) {
    vec r;
    for (int l = 0; l < LANES; l++) LANE(r, l) = sqrt(LANE(v, l));
    return r;
}

/* LANES numbers of a row of an array; where fewer are left, the last is repeated. */
INLINE vec load(const double *row, int n) {
    vec v;
    if (n == LANES) memcpy(&v, row, sizeof v);
    else for (int l = 0; l < LANES; l++) LANE(v, l) = row[l < n ? l : n - 1];
    return v;
}

INLINE void store(double *row, vec v, int n) {
    if (n == LANES) memcpy(row, &v, sizeof v);
    else for (int l = 0; l < n; l++) row[l] = LANE(v, l);
}

static COLD void of_far_angles(vec x, mask far, vec *sine, vec *cosine) {
    for (int l = 0; l < LANES; l++) {
        if (!LANE(far, l)) continue;
        LANE(*sine, l) = sin(LANE(x, l));
        LANE(*cosine, l) = cos(LANE(x, l));
    }
}

/* Sine and cosine to two units in the last place: fdlibm's polynomials (Sun Microsystems, 1993)
   after a reduction by quarter turns in two parts; libm beyond 1e5 rad. */
INLINE void sine_cosine(vec x, vec *sine, vec *cosine) {
    const vec shift = splat(6755399441055744.0); /* 1.5 * 2^52: rounds, and keeps n in its bits */
    const vec shifted = x * 6.36619772367581382433e-01 + shift;
    const vec n = shifted - shift;
    const mask quarter = BITS(shifted);
    const vec y = (x - n * 1.57079632673412561417e+00) - n * 6.07710050650619224932e-11;
    const vec z = y * y, cube = z * y, half = z * 0.5, w = 1.0 - half;
    const vec p = z * z; /* pairs of terms side by side: none waits for all the others */
    const vec ps = (-1.66666666666666324348e-01 + z * 8.33333333332248946124e-03)
        + p * ((-1.98412698298579493134e-04 + z * 2.75573137070700676789e-06)
        + p * (-2.50507602534068634195e-08 + z * 1.58969099521155010221e-10));
    const vec pc = z * ((4.16666666666666019037e-02 + z * -1.38888888888741095749e-03)
        + p * ((2.48015872894767294178e-05 + z * -2.75573143513906633035e-07)
        + p * (2.08757232129817482790e-09 + z * -1.13596475577881948265e-11)));
    const vec s = y + cube * ps;
    const vec c = w + (((1.0 - w) - half) + z * pc);
    const mask odd = -(quarter & 1); /* all bits, or none; signs are flipped by theirs */
    *sine = FROM_BITS(BITS(SELECT(odd, c, s)) ^ ((quarter & 2) << 62));
    *cosine = FROM_BITS(BITS(SELECT(odd, s, c)) ^ (((quarter + 1) & 2) << 62));
    const mask far = NOT(magnitude(x) < splat(1e5));
    if (ANY(far)) of_far_angles(x, far, sine, cosine);
}

#endif
