/* One limb, linearised: its passive twists factorised, its wrenches, what does not close, and how
   its wrenches become rows of the closure; as calib/mechanism/closure.py and elastic.py. */

#ifndef PKMCAL_LIMB_H
#define PKMCAL_LIMB_H

#include "chain.h"
#include "householder.h"

typedef struct {
    Segment *segment;   /* joints + 1 */
    vec *rest;          /* joints: what they hold by constants and parameters */
    Screw *screw;       /* joints */
    Reflectors passive; /* 6 x passives */
    vec *wrench;        /* (6, wrenches), column after column */
    vec *gap;           /* 6 */
    vec *residual;      /* wrenches */
    vec *yielding;      /* (6, yields) */
    vec *triangle;      /* (wrenches, wrenches), lower, row by row; redundant machines only */
    Reflectors driven;  /* wrenches x driven; released limbs only */
} LimbWork;

/* out (wrenches) = W^T twist */
INLINE void along_wrenches(const LimbWork *w, const vec *twist, int wrenches, vec *out) {
    for (int r = 0; r < wrenches; r++) out[r] = dot(w->wrench + 6 * r, twist, 6);
}

INLINE void forward_substitution(const vec *L, vec *b, int n) {
    for (int i = 0; i < n; i++) {
        for (int k = 0; k < i; k++) b[i] -= L[i * n + k] * b[k];
        b[i] /= L[i * n + i];
    }
}

INLINE void backward_substitution(const vec *L, vec *b, int n) {
    for (int i = n - 1; i >= 0; i--) {
        for (int k = i + 1; k < n; k++) b[i] -= L[k * n + i] * b[k];
        b[i] /= L[i * n + i];
    }
}

INLINE int is_released(const Limb *b) { return b->released && b->rows < b->wrenches; }

/* From values along the wrenches (wrenches, destroyed) to rows of the closure (rows). */
INLINE void weigh(const Machine *m, const Limb *b, const LimbWork *w, vec *values, vec *out) {
    if (m->redundant) forward_substitution(w->triangle, values, b->wrenches);
    if (m->redundant && is_released(b)) apply_transposed(&w->driven, values, b->wrenches, b->rows);
    for (int r = 0; r < b->rows; r++) out[r] = values[r];
}

/* Scaled twist (6) of a limb's end per unit of the joint j. */
INLINE void joint_twist(const Machine *m, const Limb *b, const LimbWork *w, int j,
                        const vec *origin, vec *out) {
    const Element *e = &m->element[m->moving[b->joint + j]];
    twist_of(&w->screw[j], e->turns, origin, 1.0 / m->size, out);
}

static void passive_twists(const Machine *m, const Limb *b, LimbWork *w, const vec *origin) {
    uint64_t written = 0;
    for (int j = 0; j < b->joints; j++) {
        const Element *e = &m->element[m->moving[b->joint + j]];
        for (int t = e->term; t < e->term + e->terms; t++) {
            const Term *term = &m->term[t];
            if (term->kind != PASSIVE) continue;
            const int column = term->index - b->passive;
            vec *out = w->passive.A + 6 * column, part[6];
            if (!(written >> column & 1) && term->factor == 1.0) {
                joint_twist(m, b, w, j, origin, out);
            } else {
                joint_twist(m, b, w, j, origin, part);
                for (int i = 0; i < 6; i++)
                    out[i] = (written >> column & 1 ? out[i] : splat(0.0)) + term->factor * part[i];
            }
            written |= (uint64_t)1 << column;
        }
    }
}

/* Twists of what yields, and the Cholesky factor of G = W^T C W. */
static void flexibility(const Machine *m, const Limb *b, LimbWork *w) {
    const int n = b->wrenches;
    vec along[6], *L = w->triangle;
    for (int i = 0; i < n * n; i++) L[i] = splat(0.0);
    for (int j = 0, c = 0; j < b->joints; j++) {
        const Element *e = &m->element[m->moving[b->joint + j]];
        if (e->strain < 0) continue;
        along_wrenches(w, w->yielding + 6 * c++, n, along);
        for (int r = 0; r < n; r++) {
            for (int s = 0; s <= r; s++) L[r * n + s] += e->compliance * along[r] * along[s];
        }
    }
    for (int i = 0; i < n; i++) {
        for (int j = 0; j <= i; j++) {
            vec rest = L[i * n + j];
            for (int k = 0; k < j; k++) rest -= L[i * n + k] * L[j * n + k];
            L[i * n + j] = i == j ? root(rest) : rest / L[j * n + j];
        }
    }
}

/* The combinations of the whitened rows on which the limb's actuators work. */
static void find_driven(const Machine *m, const Limb *b, LimbWork *w, const vec *origin) {
    for (int j = 0, c = 0; j < b->joints; j++) {
        const Element *e = &m->element[m->moving[b->joint + j]];
        int driven = 0;
        for (int t = e->term; t < e->term + e->terms; t++) driven |= m->term[t].kind == ACTUATOR;
        if (!driven) continue;
        vec twist[6], *column = w->driven.A + b->wrenches * c++;
        joint_twist(m, b, w, j, origin, twist);
        along_wrenches(w, twist, b->wrenches, column);
        forward_substitution(w->triangle, column, b->wrenches);
    }
    factorise(&w->driven, b->wrenches, b->rows);
}

/* What the limb's end lacks to the platform, and that along its wrenches. */
static void find_gap(const Machine *m, const Limb *b, LimbWork *w, const State *at) {
    Frame end;
    walk(m, b, w->segment, w->rest, at, w->screw, &end);
    for (int i = 0; i < 3; i++) w->gap[i] = (at->position[i] - end.point[i]) * (1.0 / m->size);
    small_rotation(end.column, at->rotation, w->gap + 3);
}

INLINE void strains_out(const Machine *m, const Limb *b, LimbWork *w, const State *at) {
    for (int j = 0, c = 0; j < b->joints; j++) {
        const Element *e = &m->element[m->moving[b->joint + j]];
        if (e->strain < 0) continue;
        vec *twist = w->yielding + 6 * c++;
        joint_twist(m, b, w, j, at->position, twist);
        for (int i = 0; i < 6; i++) w->gap[i] += twist[i] * at->strain[e->strain];
    }
}

INLINE void wrenches_of(LimbWork *w, int passives) {
    factorise(&w->passive, 6, passives);
    for (int r = 0; r < 6 - passives; r++) {
        vec *column = w->wrench + 6 * r;
        for (int i = 0; i < 6; i++) column[i] = splat(i == passives + r);
        apply(&w->passive, column, 6, passives);
    }
}

static void linearise(const Machine *m, const Limb *b, LimbWork *w, const State *at) {
    find_gap(m, b, w, at);
    passive_twists(m, b, w, at->position);
    if (b->yields) strains_out(m, b, w, at);
    switch (b->passives) { /* lengths that the compiler knows */
        case 0: wrenches_of(w, 0); break;
        case 3: wrenches_of(w, 3); break;
        case 4: wrenches_of(w, 4); break;
        case 5: wrenches_of(w, 5); break;
        default: wrenches_of(w, b->passives);
    }
    along_wrenches(w, w->gap, b->wrenches, w->residual);
    if (!m->redundant) return;
    flexibility(m, b, w);
    if (is_released(b)) find_driven(m, b, w, at->position);
}

/* New strains of a limb pulled by `twist` (6), which is left without what yields. */
static void yield_to(const Machine *m, const Limb *b, LimbWork *w, vec *twist, State *at,
                     mask going) {
    vec pull[6], force[6];
    along_wrenches(w, twist, b->wrenches, pull);
    forward_substitution(w->triangle, pull, b->wrenches);
    backward_substitution(w->triangle, pull, b->wrenches);
    for (int i = 0; i < 6; i++) {
        force[i] = splat(0.0);
        for (int r = 0; r < b->wrenches; r++) force[i] += w->wrench[6 * r + i] * pull[r];
    }
    for (int j = 0, c = 0; j < b->joints; j++) {
        const Element *e = &m->element[m->moving[b->joint + j]];
        if (e->strain < 0) continue;
        const vec *direction = w->yielding + 6 * c++;
        const vec strain = e->compliance * dot(direction, force, 6);
        for (int i = 0; i < 6; i++) twist[i] -= direction[i] * strain;
        at->strain[e->strain] = SELECT(going, strain, at->strain[e->strain]);
    }
}

INLINE void solve_passive(LimbWork *w, vec *twist, int passives) {
    apply_transposed(&w->passive, twist, 6, passives);
    solve_triangle(&w->passive, twist, 6, passives);
}

/* Passive step (leading passives of `twist`) that follows a twist (6) of the limb's end. */
INLINE void passive_step(const Limb *b, LimbWork *w, vec *twist) {
    switch (b->passives) {
        case 0: break;
        case 3: solve_passive(w, twist, 3); break;
        case 4: solve_passive(w, twist, 4); break;
        case 5: solve_passive(w, twist, 5); break;
        default: solve_passive(w, twist, b->passives);
    }
}

#endif
