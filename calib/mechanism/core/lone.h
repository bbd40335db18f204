/* A limb that one actuator holds, its end where it is wanted: five passive coordinates and the
   actuator in six equations. Each step is exact to second order in what is left (Chebyshev's
   method): with screws S_i of the joints at the origin where the platform is wanted, the end moves
   by log(exp(S_1 d_1) ... exp(S_n d_n)) = sum S_i d_i + 1/2 sum_{i<j} [S_i d_i, S_j d_j] + ... */

#ifndef PKMCAL_LONE_H
#define PKMCAL_LONE_H

#include "elimination.h"
#include "newton.h"

#define FAR 0.2       /* beyond a step like this the second order says nothing */
#define LINEAR 1e-7   /* below it the second order is less than what is foreseen */
#define LITTLE 1e-3   /* rad: the next term of a series in it is no number beside one */

typedef struct {
    Elimination equations;
    vec *twist; /* (6, joints): of each joint */
    vec *held, *value; /* joints: their angles and ways; (2, joints): as they turn and shift */
    vec step[6];
} LoneWork;

INLINE int is_lone(const Limb *b) { return b->wrenches == 1 && b->owns == 1 && b->moved == 63; }

/* Cosine and sine (2) of an angle that has grown by so little that a short series tells how. */
INLINE void turn_little(vec grown, vec *value) {
    const vec square = grown * grown, c = value[0], s = value[1];
    const vec sine = grown - grown * square * (1.0 / 6.0);
    const vec rest = square * (square * (1.0 / 24.0) - 0.5); /* the cosine less one */
    value[0] = c + (c * rest - s * sine);
    value[1] = s + (s * rest + c * sine);
}

/* What every joint holds: cosine and sine of an angle, or a way. All before the walk, so that none
   waits for the frames. */
INLINE void joint_values(const Machine *m, const Limb *b, const LimbWork *w, LoneWork *d,
                         const State *at, int fresh) {
    for (int j = 0; j < b->joints; j++) {
        const Element *e = &m->element[m->moving[b->joint + j]];
        const vec held =
            e->strain >= 0 ? at->strain[e->strain] : w->rest[j] + moved_value(m, e, at);
        const vec grown = held - d->held[j];
        vec *value = d->value + 2 * j;
        if (!e->turns) value[0] = held;
        else if (!fresh && ALL(magnitude(grown) < splat(LITTLE))) turn_little(grown, value);
        else sine_cosine(held, value + 1, value);
        d->held[j] = held;
    }
}

/* Twist of a joint where the walk is, then past it. */
INLINE void meet(Frame *f, int turns, int axis, const vec *value, const vec *origin,
                 double per_size, vec *twist) {
    const vec *direction = f->column[axis];
    if (!turns) {
        for (int i = 0; i < 3; i++) twist[i] = direction[i] * per_size;
        twist[3] = twist[4] = twist[5] = splat(0.0);
        go(f, axis, value[0]);
        return;
    }
    vec arm[3];
    for (int i = 0; i < 3; i++) arm[i] = (origin[i] - f->point[i]) * per_size;
    cross(direction, arm, twist);
    for (int i = 0; i < 3; i++) twist[3 + i] = direction[i];
    turn(f, axis, value[0], value[1]);
}

/* Walk along the limb: the twists of its joints, and what its end lacks to the platform. */
static void lone_walk(const Machine *m, const Limb *b, LimbWork *w, LoneWork *d, const State *at,
                      int fresh) {
    const double per_size = 1.0 / m->size;
    Frame end;
    joint_values(m, b, w, d, at, fresh);
    begin_behind(&end, w->segment);
    for (int j = 0; j < b->joints; j++) {
        const Element *e = &m->element[m->moving[b->joint + j]];
        vec *twist = d->twist + 6 * j;
        switch (e->axis) { /* each by itself, so that the frame stays in registers */
            case 0: meet(&end, e->turns, 0, d->value + 2 * j, at->position, per_size, twist); break;
            case 1: meet(&end, e->turns, 1, d->value + 2 * j, at->position, per_size, twist); break;
            default: meet(&end, e->turns, 2, d->value + 2 * j, at->position, per_size, twist);
        }
        pass(&end, w->segment + j + 1);
    }
    for (int i = 0; i < 3; i++) w->gap[i] = (at->position[i] - end.point[i]) * per_size;
    small_rotation(end.column, at->rotation, w->gap + 3);
}

/* The order of elimination by the first lane. */
static void order_columns(const Machine *m, const Limb *b, LoneWork *d) {
    double column[6][6] = {{0.0}};
    for (const Mover *of = m->mover + b->mover; of < m->mover + b->mover + b->movers; of++)
        for (int i = 0; i < 6; i++)
            column[of->unknown][i] += of->factor * LANE(d->twist[6 * of->joint + i], 0);
    choose_order(&d->equations, (const double(*)[6])column);
}

/* The six columns, each per unit of its unknown, ordered. */
INLINE void lone_columns(const Machine *m, const Limb *b, LoneWork *d) {
    Elimination *q = &d->equations;
    if (!q->known) order_columns(m, b, d);
    for (const Mover *of = m->mover + b->mover; of < m->mover + b->mover + b->movers; of++) {
        const vec *twist = d->twist + 6 * of->joint;
        vec *to = q->A + 6 * q->column[of->unknown];
        const vec factor = splat(of->factor);
        if (of->first)
            for (int i = 0; i < 6; i++) to[q->row[i]] = factor * twist[i];
        else
            for (int i = 0; i < 6; i++) to[q->row[i]] += factor * twist[i];
    }
}

/* What the second order of a step adds to the gap, twice (6). */
INLINE void second_order(const Machine *m, const Limb *b, const LimbWork *w, const LoneWork *d,
                         vec *out) {
    const vec zero = splat(0.0);
    vec before[6], part[3], more[3];
    cross(w->gap + 3, w->gap, out);
    out[3] = out[4] = out[5] = zero;
    for (int k = 0; k < b->movers; k++) {
        const Mover *of = &m->mover[b->mover + k];
        const vec *twist = d->twist + 6 * of->joint;
        const vec moved = d->step[of->unknown] * of->factor;
        const int turns = m->element[m->moving[b->joint + of->joint]].turns;
        vec v[3], omega[3];
        for (int i = 0; i < 3; i++) v[i] = twist[i] * moved;
        if (k) cross(before + 3, v, part);
        for (int i = 0; k && i < 3; i++) out[i] -= part[i];
        if (turns) {
            for (int i = 0; i < 3; i++) omega[i] = twist[3 + i] * moved;
            if (k) cross(before, omega, part);
            if (k) cross(before + 3, omega, more);
            for (int i = 0; k && i < 3; i++) out[i] -= part[i];
            for (int i = 0; k && i < 3; i++) out[3 + i] -= more[i];
        }
        for (int i = 0; i < 3; i++) before[i] = k ? before[i] + v[i] : v[i];
        for (int i = 0; i < 3; i++)
            before[3 + i] = k ? (turns ? before[3 + i] + omega[i] : before[3 + i])
                              : (turns ? omega[i] : zero);
    }
}

INLINE vec largest_of(const vec *step) {
    Largest size = {splat(0.0), splat(0.0)};
    for (int c = 0; c < 6; c++) measure(&size, step[c], 1.0);
    return measured(&size);
}

/* Whether the step could be made; else nothing has changed. */
static int lone_step(const Machine *m, const Limb *b, LimbWork *w, LoneWork *d, State *at,
                     int fresh, Progress *p) {
    vec more[6], left[6];
    lone_walk(m, b, w, d, at, fresh);
    lone_columns(m, b, d);
    if (!ALL(eliminate(&d->equations) | NOT(p->going))) {
        d->equations.known = 0;
        return 0;
    }
    solve_eliminated(&d->equations, w->gap, d->step);
    const vec first = largest_of(d->step);
    vec size = first;
    if (!ALL((first < splat(LINEAR)) | NOT(p->going))) {
        second_order(m, b, w, d, left);
        solve_eliminated(&d->equations, left, more);
        for (int c = 0; c < 6; c++)
            d->step[c] += SELECT(first < splat(FAR), 0.5 * more[c], splat(0.0));
        size = largest_of(d->step);
    }
    mask taken;
    const vec scale = judge(p, size, 3, &taken);
    for (int k = 0; k < 5; k++)
        advance(&at->passive[b->passive + k], d->step[k] * (1.0 / m->per_passive_unit[b->passive + k]),
                scale, taken);
    advance(&at->extension[b->own[0]], d->step[5] * (1.0 / m->per_actuator_unit[b->own[0]]), scale,
            taken);
    return 1;
}

/* Iterate until the limb has closed in every pose of the block, or cannot; whether all steps could
   be made. */
static int solve_lone(const Machine *m, const Limb *b, LimbWork *w, LoneWork *d, State *at,
                      Progress *p) {
    for (int k = 0; k < MAX_ITERATIONS && ANY(p->going); k++)
        if (!lone_step(m, b, w, d, at, k == 0, p)) return 0;
    across(&d->equations, w->wrench);
    return 1;
}

#endif
