/* Newton's method on a block of poses, each with its own progress; as calib/mechanism/newton.py.

   Near the solution a machine without redundancy takes steps by its last linearisation: they cost
   a walk along the limbs and nothing else, and each leaves a small part of what was left. */

#ifndef PKMCAL_NEWTON_H
#define PKMCAL_NEWTON_H

#include "closure.h"

#define MAX_ITERATIONS 60
#define MAX_STEP 0.4
#define TOLERANCE 1e-10
#define STAGNATION 1e-8
#define FORESEEN 1e-13 /* a step that will leave less is the last */
#define CURVED 10.0    /* Newton's steps leave their square, times this at least */
#define NEAR 1e-4     /* after a step this small the next goes by the last linearisation */
#define SLOWER 0.1    /* unless the step before shrank by less than this */

typedef struct {
    vec previous, iterations, conditioning;
    mask going, converged;
} Progress;

INLINE Progress begun(void) {
    Progress p;
    p.previous = splat(INFINITY);
    p.iterations = splat(0.0);
    p.conditioning = splat(NAN);
    p.going = splat(0.0) == splat(0.0);
    p.converged = NOT(p.going);
    return p;
}

/* What a step of this size will leave, where it and the one before were exact to first order (2) or
   second (3) in what was left; nothing is known of others (0). */
INLINE vec leaves(const Progress *p, vec size, int order) {
    const vec shrunk = size / p->previous;
    if (order == 3) return SELECT(p->previous < splat(INFINITY), size * shrunk * shrunk, size);
    if (order == 2) return size * larger(CURVED * size, shrunk / p->previous * size);
    return size;
}

/* What a step of this size means: which poses take it, and which go on after it. */
INLINE vec judge(Progress *p, vec size, int order, mask *taken) {
    const mask fine = is_finite(size);
    const mask closed = (size < splat(TOLERANCE))
        | ((size < splat(STAGNATION)) & (size > 0.5 * p->previous))
        | (leaves(p, size, order) < splat(FORESEEN));
    *taken = p->going & fine;
    p->iterations = SELECT(p->going, p->iterations + 1.0, p->iterations);
    p->converged |= p->going & closed;
    p->previous = SELECT(p->going, size, p->previous);
    p->going = p->going & fine & NOT(closed);
    return SELECT(size > splat(MAX_STEP), MAX_STEP / size, splat(1.0));
}

/* Whether all poses that go on are so near that the last linearisation serves them. */
INLINE int all_near(const Progress *p, vec before) {
    const mask near = (p->previous < splat(NEAR))
        & ((before >= splat(NEAR)) | (p->previous < SLOWER * before));
    return ALL(near | NOT(p->going));
}

static void step(const Machine *m, Work *w, State *at, const Target *to, int anew, Progress *p) {
    Largest size = {splat(0.0), splat(0.0)};
    if (anew) {
        hold_platform(m, w, at);
        factorise_platform(m, w);
        p->conditioning = SELECT(p->going, w->conditioning, p->conditioning);
    } else {
        close_gaps(m, w, at);
    }
    platform_twist(m, w, w->gap);
    for (int i = 0; i < 6; i++) w->dx[i] = -w->gap[i];
    if (to) {
        towards_target(m, w, at, to, anew);
        for (int a = 0; a < m->actuators; a++) measure(&size, w->ds[a], m->per_actuator_unit[a]);
    }
    for (int i = 0; i < 6; i++) measure(&size, w->dx[i], 1.0);
    for (int i = 0; i < m->limbs; i++) {
        const Limb *b = &m->limb[i];
        vec twist[6];
        for (int k = 0; k < 6; k++) twist[k] = w->limb[i].gap[k] + w->dx[k];
        if (to) drive(m, b, &w->limb[i], w->ds, at, twist);
        if (m->redundant) yield_to(m, b, &w->limb[i], twist, at, p->going);
        passive_step(b, &w->limb[i], twist);
        for (int k = 0; k < b->passives; k++) {
            w->dpassive[b->passive + k] = twist[k];
            measure(&size, twist[k], m->per_passive_unit[b->passive + k]);
        }
    }
    mask taken;
    const vec scale = judge(p, measured(&size), anew && !m->redundant ? 2 : 0, &taken);
    vec turn[3];
    for (int i = 0; i < 3; i++) {
        advance(&at->position[i], w->dx[i] * m->size, scale, taken);
        turn[i] = SELECT(taken, w->dx[3 + i] * scale, splat(0.0));
    }
    turn_by(turn, at->rotation);
    for (int k = 0; k < m->passives; k++) advance(&at->passive[k], w->dpassive[k], scale, taken);
    for (int a = 0; to && a < m->actuators; a++) advance(&at->extension[a], w->ds[a], scale, taken);
}

/* Iterate until every pose of the block has closed or has failed. */
static Progress solve_block(const Machine *m, Work *w, State *at, const Target *to) {
    Progress p = begun();
    int anew = 1;
    for (int k = 0; k < MAX_ITERATIONS && ANY(p.going); k++) {
        const vec before = p.previous;
        step(m, w, at, to, anew, &p);
        anew = m->redundant || !all_near(&p, before);
    }
    return p;
}

#endif
