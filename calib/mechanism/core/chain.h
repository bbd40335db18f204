/* Chains of elements: frames that walk along a limb, and the screws of what they pass. */

#ifndef PKMCAL_CHAIN_H
#define PKMCAL_CHAIN_H

#include "lanes.h"
#include "machine.h"

/* Where a block of LANES poses stands; every array one vec a component. */
typedef struct { vec *position, *rotation, *passive, *extension, *strain; } State;

typedef struct { vec column[3][3], point[3]; } Frame;
typedef struct { vec direction[3], point[3]; } Screw;

/* What is fixed before a moving element, or after the last: along `axes` (a bit each), turned or not. */
typedef struct { int turned, axes; vec rotation[3][3], point[3]; } Segment;

INLINE void begin(Frame *f) {
    for (int j = 0; j < 3; j++) {
        for (int i = 0; i < 3; i++) f->column[j][i] = splat(i == j);
        f->point[j] = splat(0.0);
    }
}

INLINE void turn(Frame *f, int axis, vec c, vec s) {
    const int k = (axis + 1) % 3, l = (axis + 2) % 3;
    for (int i = 0; i < 3; i++) {
        const vec a = f->column[k][i], b = f->column[l][i];
        f->column[k][i] = a * c + b * s;
        f->column[l][i] = b * c - a * s;
    }
}

INLINE void go(Frame *f, int axis, vec way) {
    for (int i = 0; i < 3; i++) f->point[i] += f->column[axis][i] * way;
}

INLINE void move(Frame *f, int turns, int axis, vec value) {
    if (turns) {
        vec s, c;
        sine_cosine(value, &s, &c);
        turn(f, axis, c, s);
    } else {
        go(f, axis, value);
    }
}

INLINE void quarter_turns(Frame *f, int axis, int count) {
    const int k = (axis + 1) % 3, l = (axis + 2) % 3;
    for (; count > 0; count--) {
        for (int i = 0; i < 3; i++) {
            const vec a = f->column[k][i];
            f->column[k][i] = f->column[l][i];
            f->column[l][i] = -a;
        }
    }
}

INLINE void pass(Frame *f, const Segment *s) {
    if (s->axes & 1) go(f, 0, s->point[0]);
    if (s->axes & 2) go(f, 1, s->point[1]);
    if (s->axes & 4) go(f, 2, s->point[2]);
    if (!s->turned) return;
    for (int i = 0; i < 3; i++) {
        const vec a = f->column[0][i], b = f->column[1][i], c = f->column[2][i];
        for (int j = 0; j < 3; j++)
            f->column[j][i] = a * s->rotation[0][j] + b * s->rotation[1][j] + c * s->rotation[2][j];
    }
}

/* Begin behind the first segment. */
INLINE void begin_behind(Frame *f, const Segment *s) {
    begin(f);
    for (int i = 0; i < 3; i++) {
        if (s->axes & (1 << i)) f->point[i] = s->point[i];
    }
    if (!s->turned) return;
    for (int j = 0; j < 3; j++)
        for (int i = 0; i < 3; i++) f->column[j][i] = s->rotation[i][j];
}

INLINE void cross(const vec *a, const vec *b, vec *out) {
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}

/* Scaled twist (6) at `origin` per unit of an element. */
INLINE void twist_of(const Screw *at, int turns, const vec *origin, double per_size, vec *out) {
    if (!turns) {
        for (int i = 0; i < 3; i++) {
            out[i] = at->direction[i] * per_size;
            out[3 + i] = splat(0.0);
        }
        return;
    }
    vec arm[3];
    for (int i = 0; i < 3; i++) arm[i] = origin[i] - at->point[i];
    cross(at->direction, arm, out);
    for (int i = 0; i < 3; i++) {
        out[i] *= per_size;
        out[3 + i] = at->direction[i];
    }
}

/* Rotation vector, exact to first order, from frame columns A to rotation B (3, 3), row by row. */
INLINE void small_rotation(vec A[3][3], const vec *B, vec *out) {
    vec part[3], column[3];
    for (int i = 0; i < 3; i++) out[i] = splat(0.0);
    for (int j = 0; j < 3; j++) {
        for (int i = 0; i < 3; i++) column[i] = B[3 * i + j];
        cross(A[j], column, part);
        for (int i = 0; i < 3; i++) out[i] += part[i];
    }
    for (int i = 0; i < 3; i++) out[i] *= 0.5;
}

/* Value of an element's constant and parameters; parameters (P) one vec each. */
INLINE vec held_value(const Machine *m, const Element *e, const vec *parameters) {
    vec value = splat(e->constant);
    for (int t = e->term; t < e->term + e->terms; t++) {
        if (m->term[t].kind == PARAMETER)
            value += m->term[t].factor * parameters[m->term[t].index];
    }
    return value;
}

/* What the poses add to it. */
INLINE vec moved_value(const Machine *m, const Element *e, const State *at) {
    vec value = splat(0.0);
    for (int t = e->term; t < e->term + e->terms; t++) {
        const Term *term = &m->term[t];
        if (term->kind == PARAMETER) continue;
        value += term->factor * (term->kind == PASSIVE ? at->passive : at->extension)[term->index];
    }
    return value;
}

/* The fixed segments of a limb (joints + 1) and what its joints hold at rest (joints). */
static void fix(const Machine *m, const Limb *b, const vec *parameters, Segment *segment, vec *rest) {
    Frame f;
    begin(&f);
    segment->turned = segment->axes = 0;
    for (int k = b->element; k <= b->element + b->elements; k++) {
        const Element *e = &m->element[k];
        const int last = k == b->element + b->elements;
        if (last || e->joint >= 0) {
            for (int j = 0; j < 3; j++) {
                segment->point[j] = f.point[j];
                for (int i = 0; i < 3; i++) segment->rotation[i][j] = f.column[j][i];
            }
            if (last) return;
            if (e->strain < 0) *rest = held_value(m, e, parameters);
            rest++;
            segment++;
            segment->turned = segment->axes = 0;
            begin(&f);
        } else if (e->quarters >= 0) {
            quarter_turns(&f, e->axis, e->quarters);
            segment->turned |= e->quarters != 0;
        } else if (e->terms || e->constant != 0.0) {
            move(&f, e->turns, e->axis, held_value(m, e, parameters));
            segment->turned |= e->turns;
            if (!e->turns) segment->axes |= segment->turned ? 7 : 1 << e->axis;
        }
    }
}

/* Walk along a limb by its segments: the end frame, and the screws of its joints. */
INLINE void walk(const Machine *m, const Limb *b, const Segment *segment, const vec *rest,
                 const State *at, Screw *screw, Frame *end) {
    begin_behind(end, segment);
    for (int j = 0; j < b->joints; j++) {
        const Element *e = &m->element[m->moving[b->joint + j]];
        for (int i = 0; i < 3; i++) {
            screw[j].direction[i] = end->column[e->axis][i];
            screw[j].point[i] = end->point[i];
        }
        move(end, e->turns, e->axis,
             e->strain >= 0 ? at->strain[e->strain] : rest[j] + moved_value(m, e, at));
        pass(end, segment + j + 1);
    }
}

/* Walk along all elements of a limb: the screw of each. */
static void walk_all(const Machine *m, const Limb *b, const vec *parameters, const State *at,
                     Screw *screw) {
    Frame f;
    begin(&f);
    for (int k = b->element; k < b->element + b->elements; k++, screw++) {
        const Element *e = &m->element[k];
        for (int i = 0; i < 3; i++) {
            screw->direction[i] = f.column[e->axis][i];
            screw->point[i] = f.point[i];
        }
        if (e->strain >= 0)
            move(&f, e->turns, e->axis, at->strain[e->strain]);
        else if (e->quarters >= 0)
            quarter_turns(&f, e->axis, e->quarters);
        else if (e->terms || e->constant != 0.0)
            move(&f, e->turns, e->axis, held_value(m, e, parameters) + moved_value(m, e, at));
    }
}

#endif
