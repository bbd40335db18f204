/* Derivatives of the pose by every parameter and actuator; as calib/mechanism/jacobian.py. */

#ifndef PKMCAL_JACOBIAN_H
#define PKMCAL_JACOBIAN_H

#include "closure.h"

/* Twist of the platform (6, rows), in mm and rad, per unit of each row of the closure. */
static void pseudo_inverse(const Machine *m, Work *w, vec *out, vec *unit) {
    for (int r = 0; r < m->rows; r++) {
        for (int k = 0; k < m->rows; k++) unit[k] = splat(k == r);
        platform_twist(m, w, unit);
        for (int i = 0; i < 6; i++) out[6 * r + i] = i < 3 ? unit[i] * m->size : unit[i];
    }
}

/* Twist (6) of the platform per unit of one element; `inverse` (6, rows of the limb). */
INLINE void element_answer(const Machine *m, const Limb *b, const LimbWork *w, const Screw *screw,
                           int turns, const vec *origin, const vec *inverse, vec *out) {
    vec twist[6], along[6], row[6];
    twist_of(screw, turns, origin, 1.0 / m->size, twist);
    along_wrenches(w, twist, b->wrenches, along);
    weigh(m, b, w, along, row);
    for (int i = 0; i < 6; i++) out[i] = splat(0.0);
    for (int r = 0; r < b->rows; r++) {
        for (int i = 0; i < 6; i++) out[i] += inverse[6 * r + i] * row[r];
    }
}

/* out (parameters + actuators, 6) of a block; screw: of all elements of the longest limb. */
static void differentiate(const Machine *m, Work *w, const State *at, vec *inverse, vec *unit,
                          Screw *screw, vec *out) {
    hold_platform(m, w, at);
    factorise_platform(m, w);
    pseudo_inverse(m, w, inverse, unit);
    for (int k = 0; k < 6 * (m->parameters + m->actuators); k++) out[k] = splat(0.0);
    for (int i = 0, row = 0; i < m->limbs; row += m->limb[i++].rows) {
        const Limb *b = &m->limb[i];
        if (!b->rows) continue;
        walk_all(m, b, w->parameters, at, screw);
        for (int k = 0; k < b->elements; k++) {
            const Element *e = &m->element[b->element + k];
            vec moved[6];
            int known = 0;
            for (int t = e->term; t < e->term + e->terms; t++) {
                const Term *term = &m->term[t];
                if (term->kind == PASSIVE) continue;
                if (!known)
                    element_answer(m, b, &w->limb[i], &screw[k], e->turns, at->position,
                                   inverse + 6 * row, moved);
                known = 1;
                vec *to = out + 6 * (term->kind == PARAMETER ? term->index
                                                             : m->parameters + term->index);
                for (int c = 0; c < 6; c++) to[c] += term->factor * moved[c];
            }
        }
    }
}

/* out (places, 6): the same of single elements, each place a limb and an element of its chain. */
static void lock(const Machine *m, Work *w, const State *at, vec *inverse, vec *unit, Screw *screw,
                 const int *place, int places, vec *out) {
    hold_platform(m, w, at);
    factorise_platform(m, w);
    pseudo_inverse(m, w, inverse, unit);
    for (int i = 0, row = 0; i < m->limbs; row += m->limb[i++].rows) {
        const Limb *b = &m->limb[i];
        walk_all(m, b, w->parameters, at, screw);
        for (int p = 0; p < places; p++) {
            const int k = place[2 * p + 1];
            if (place[2 * p] == i)
                element_answer(m, b, &w->limb[i], &screw[k], m->element[b->element + k].turns,
                               at->position, inverse + 6 * row, out + 6 * p);
        }
    }
}

#endif
