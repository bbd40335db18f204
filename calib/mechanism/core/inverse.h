/* Inverse kinematics limb by limb: where the whole pose is commanded and every limb has actuators of
   its own, as many as it carries wrenches, the limbs have nothing to do with one another. */

#ifndef PKMCAL_INVERSE_H
#define PKMCAL_INVERSE_H

#include "lone.h"

typedef struct { Reflectors q; vec *twist, *step; LoneWork *lone; } DrivenWork;

/* Twists (6) of the limb's actuators, and the answers of its wrenches to them, factorised. */
static void find_answers(const Machine *m, const Limb *b, LimbWork *w, DrivenWork *d,
                         const vec *origin) {
    const int n = b->wrenches;
    vec part[6];
    for (int i = 0; i < 6 * n; i++) d->twist[i] = splat(0.0);
    for (int j = 0; j < b->joints; j++) {
        const Element *e = &m->element[m->moving[b->joint + j]];
        for (int t = e->term; t < e->term + e->terms; t++) {
            if (m->term[t].kind != ACTUATOR) continue;
            int c = 0;
            while (b->own[c] != m->term[t].index) c++;
            joint_twist(m, b, w, j, origin, part);
            for (int i = 0; i < 6; i++) d->twist[6 * c + i] += m->term[t].factor * part[i];
        }
    }
    for (int c = 0; c < n; c++) along_wrenches(w, d->twist + 6 * c, n, d->q.A + c * n);
    if (n == 1) d->q.inverse[0] = 1.0 / d->q.A[0];
    else factorise(&d->q, n, n);
}

static void limb_step(const Machine *m, const Limb *b, LimbWork *w, DrivenWork *d, State *at,
                      int anew, Progress *p) {
    const int n = b->wrenches;
    Largest size = {splat(0.0), splat(0.0)};
    if (anew) {
        linearise(m, b, w, at);
        find_answers(m, b, w, d, at->position);
    } else {
        find_gap(m, b, w, at);
        along_wrenches(w, w->gap, n, w->residual);
    }
    if (n == 1) {
        d->step[0] = w->residual[0] * d->q.inverse[0];
    } else {
        for (int c = 0; c < n; c++) d->step[c] = w->residual[c];
        apply_transposed(&d->q, d->step, n, n);
        solve_triangle(&d->q, d->step, n, n);
    }
    vec twist[6];
    for (int i = 0; i < 6; i++) twist[i] = w->gap[i];
    for (int c = 0; c < n; c++) {
        for (int i = 0; i < 6; i++) twist[i] -= d->twist[6 * c + i] * d->step[c];
        measure(&size, d->step[c], m->per_actuator_unit[b->own[c]]);
    }
    passive_step(b, w, twist);
    for (int k = 0; k < b->passives; k++)
        measure(&size, twist[k], m->per_passive_unit[b->passive + k]);
    mask taken;
    const vec scale = judge(p, measured(&size), anew ? 2 : 0, &taken);
    for (int k = 0; k < b->passives; k++)
        advance(&at->passive[b->passive + k], twist[k], scale, taken);
    for (int c = 0; c < n; c++) advance(&at->extension[b->own[c]], d->step[c], scale, taken);
}

/* Iterate until the limb has closed in every pose of the block, or cannot. */
static void solve_driven(const Machine *m, const Limb *b, LimbWork *w, DrivenWork *d, State *at,
                         Progress *p) {
    int anew = 1;
    for (int k = 0; k < MAX_ITERATIONS && ANY(p->going); k++) {
        const vec before = p->previous;
        limb_step(m, b, w, d, at, anew, p);
        anew = !all_near(p, before);
    }
}

/* `at` holds the platform where it is wanted. */
static Progress solve_limbs(const Machine *m, Work *w, DrivenWork *d, State *at) {
    Progress all = begun();
    all.converged = all.going;
    int row = 0;
    for (int i = 0; i < m->limbs; i++) {
        const Limb *b = &m->limb[i];
        Progress p = begun();
        if (!is_lone(b) || !solve_lone(m, b, &w->limb[i], d[i].lone, at, &p))
            solve_driven(m, b, &w->limb[i], &d[i], at, &p);
        all.converged &= p.converged;
        all.iterations = larger(p.iterations, all.iterations);
        for (int r = 0; r < b->rows; r++, row++) {
            for (int c = 0; c < 6; c++)
                w->platform.A[c * m->rows + row] = w->limb[i].wrench[6 * r + c];
        }
    }
    factorise_platform(m, w);
    all.conditioning = w->conditioning;
    return all;
}

#endif
