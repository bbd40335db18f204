/* All limbs of a block of poses, linearised, and the platform that they hold; one step of Newton's
   method, forward or inverse; as calib/mechanism/closure.py, newton.py and task.py. */

#ifndef PKMCAL_CLOSURE_H
#define PKMCAL_CLOSURE_H

#include "limb.h"

typedef struct {
    LimbWork *limb;
    vec *parameters;     /* P: of this block, or shared by all */
    Reflectors platform; /* rows x 6 */
    vec *gap;            /* rows */
    vec *answer;         /* (rows, actuators), column after column */
    vec *task_answer;    /* as tasks x actuators, and its reflectors' numbers */
    Reflectors inner;
    vec *error;          /* tasks */
    vec *dx;             /* 6 */
    vec *ds;             /* actuators */
    vec *dpassive;       /* passives */
    vec conditioning;
} Work;

typedef struct {
    const double *row;  /* (tasks, N) or NULL for a forward problem */
    vec *value;         /* tasks: of this block */
    vec goal[9];        /* rotation, where all six coordinates are commanded */
} Target;

/* Rows A (rows, 6) and gaps of the closure, one limb after the other, and A factorised. */
static void hold_platform(const Machine *m, Work *w, const State *at) {
    vec values[6], out[6];
    int row = 0;
    for (int i = 0; i < m->limbs; i++) {
        const Limb *b = &m->limb[i];
        LimbWork *limb = &w->limb[i];
        linearise(m, b, limb, at);
        for (int c = 0; c <= 6; c++) {
            for (int r = 0; r < b->wrenches; r++)
                values[r] = c < 6 ? limb->wrench[6 * r + c] : limb->residual[r];
            weigh(m, b, limb, values, out);
            vec *to = c < 6 ? w->platform.A + c * m->rows : w->gap;
            for (int r = 0; r < b->rows; r++) to[row + r] = out[r];
        }
        row += b->rows;
    }
}

static void factorise_platform(const Machine *m, Work *w) {
    if (m->rows == 6) factorise(&w->platform, 6, 6);
    else factorise(&w->platform, m->rows, 6);
    w->conditioning = diagonal_ratio(&w->platform, 6);
}

/* Gaps alone, by the wrenches of the last linearisation (machines without redundancy). */
static void close_gaps(const Machine *m, Work *w, const State *at) {
    int row = 0;
    for (int i = 0; i < m->limbs; i++) {
        LimbWork *limb = &w->limb[i];
        find_gap(m, &m->limb[i], limb, at);
        along_wrenches(limb, limb->gap, m->limb[i].wrenches, w->gap + row);
        row += m->limb[i].rows;
    }
}

/* Twist of the platform (leading 6 of b) for values b (rows) of the rows. */
INLINE void platform_twist(const Machine *m, Work *w, vec *b) {
    if (m->rows == 6) {
        apply_transposed(&w->platform, b, 6, 6);
        solve_triangle(&w->platform, b, 6, 6);
    } else {
        apply_transposed(&w->platform, b, m->rows, 6);
        solve_triangle(&w->platform, b, m->rows, 6);
    }
}

INLINE void rotation_of(const vec *euler, vec *R) {
    vec sa, ca, sb, cb, sg, cg;
    sine_cosine(euler[0], &sa, &ca);
    sine_cosine(euler[1], &sb, &cb);
    sine_cosine(euler[2], &sg, &cg);
    R[0] = cg * cb; R[1] = cg * sb * sa - sg * ca; R[2] = cg * sb * ca + sg * sa;
    R[3] = sg * cb; R[4] = sg * sb * sa + cg * ca; R[5] = sg * sb * ca - cg * sa;
    R[6] = -sb;     R[7] = cb * sa;                R[8] = cb * ca;
}

/* Answers (rows, actuators) of the rows to the actuators. */
static void actuator_answers(const Machine *m, Work *w, const State *at) {
    vec twist[6], along[6], out[6];
    for (int i = 0; i < m->rows * m->actuators; i++) w->answer[i] = splat(0.0);
    for (int i = 0, row = 0; i < m->limbs; row += m->limb[i++].rows) {
        const Limb *b = &m->limb[i];
        for (int j = 0; j < b->joints; j++) {
            const Element *e = &m->element[m->moving[b->joint + j]];
            for (int t = e->term; t < e->term + e->terms; t++) {
                const Term *term = &m->term[t];
                if (term->kind != ACTUATOR) continue;
                joint_twist(m, b, &w->limb[i], j, at->position, twist);
                along_wrenches(&w->limb[i], twist, b->wrenches, along);
                weigh(m, b, &w->limb[i], along, out);
                vec *to = w->answer + term->index * m->rows + row;
                for (int r = 0; r < b->rows; r++) to[r] += term->factor * out[r];
            }
        }
    }
}

/* One angle of R = Rz Ry Rx, and the matrix row that turns omega into its rate, of each lane. */
static void angle_of(const vec *R, int which, vec *angle, vec *rate) {
    for (int l = 0; l < LANES; l++) {
        const double ry = atan2(-LANE(R[6], l), hypot(LANE(R[0], l), LANE(R[3], l)));
        const double rz = atan2(LANE(R[3], l), LANE(R[0], l));
        const double cb = cos(ry), sb = sin(ry), cg = cos(rz), sg = sin(rz);
        const double rates[3][3] = {
            {cg / cb, sg / cb, 0.0}, {-sg, cg, 0.0}, {cg * sb / cb, sg * sb / cb, 1.0}};
        const double angles[3] = {atan2(LANE(R[7], l), LANE(R[8], l)), ry, rz};
        LANE(*angle, l) = angles[which];
        for (int i = 0; i < 3; i++) LANE(rate[i], l) = rates[which][i];
    }
}

INLINE vec wrapped(vec angle) {
    for (int l = 0; l < LANES; l++) {
        const double whole = 6.283185307179586;
        double rest = fmod(LANE(angle, l) + 3.141592653589793, whole);
        if (rest < 0.0) rest += whole;
        LANE(angle, l) = rest - 3.141592653589793;
    }
    return angle;
}

/* What is left of the task, and the rows T (6) of one task coordinate for a twist in mm and rad. */
INLINE vec task_row(const Machine *m, int k, const Target *to, const State *at, vec *T) {
    const vec *R = at->rotation;
    const int task = m->task[k];
    for (int i = 0; i < 6; i++) T[i] = splat(0.0);
    if (task < 3) {
        T[task] = splat(1.0);
        return to->value[k] - at->position[task];
    }
    if (task < TILT) {
        vec angle;
        angle_of(R, task - 3, &angle, T + 3);
        return wrapped(to->value[k] - angle);
    }
    vec tilt = splat(0.0), azimuth = splat(0.0), s, c, st, ct;
    for (int i = 0; i < m->tasks; i++) {
        if (m->task[i] == TILT) tilt = to->value[i];
        if (m->task[i] == AZIMUTH) azimuth = to->value[i];
    }
    sine_cosine(tilt, &st, &ct);
    sine_cosine(azimuth, &s, &c);
    if (task == TILT) {
        T[4] = R[8];
        T[5] = -R[5];
        return st * c - R[2];
    }
    T[3] = -R[8];
    T[5] = R[2];
    return st * s - R[5];
}

/* Pose and extension steps that close the limbs and remove the task error together; with the
   answers of the last linearisation where none is made anew. */
static void towards_target(const Machine *m, Work *w, const State *at, const Target *to, int anew) {
    vec T[6], left[3], columns[3][3];
    if (m->full) {
        for (int j = 0; j < 3; j++)
            for (int i = 0; i < 3; i++) columns[j][i] = at->rotation[3 * i + j];
        small_rotation(columns, to->goal, left);
    }
    if (anew) {
        actuator_answers(m, w, at);
        for (int a = 0; a < m->actuators; a++) platform_twist(m, w, w->answer + a * m->rows);
    }
    for (int k = 0; k < m->tasks; k++) {
        vec error;
        if (m->full) {
            for (int i = 0; i < 6; i++) T[i] = splat(i == k);
            error = k < 3 ? to->value[k] - at->position[k] : left[k - 3];
        } else {
            error = task_row(m, k, to, at, T);
        }
        for (int i = 0; i < 3; i++) T[i] *= m->size;
        w->error[k] = error - dot(T, w->dx, 6);
        for (int a = 0; anew && a < m->actuators; a++)
            w->task_answer[a * m->tasks + k] = dot(T, w->answer + a * m->rows, 6);
    }
    if (anew) factorise(&w->inner, m->tasks, m->actuators);
    apply_transposed(&w->inner, w->error, m->tasks, m->actuators);
    solve_triangle(&w->inner, w->error, m->tasks, m->actuators);
    for (int a = 0; a < m->actuators; a++) {
        w->ds[a] = w->error[a];
        for (int i = 0; i < 6; i++) w->dx[i] += w->answer[a * m->rows + i] * w->ds[a];
    }
}

/* Take from the twist (6) of a limb's end what its actuators do when they move by ds. */
INLINE void drive(const Machine *m, const Limb *b, LimbWork *w, const vec *ds, const State *at,
                  vec *twist) {
    vec part[6];
    for (int j = 0; j < b->joints; j++) {
        const Element *e = &m->element[m->moving[b->joint + j]];
        for (int t = e->term; t < e->term + e->terms; t++) {
            if (m->term[t].kind != ACTUATOR) continue;
            joint_twist(m, b, w, j, at->position, part);
            const vec share = m->term[t].factor * ds[m->term[t].index];
            for (int i = 0; i < 6; i++) twist[i] -= part[i] * share;
        }
    }
}

/* The largest of all steps, each in its own unit; not a number where one of them is none. */
typedef struct { vec most, sum; } Largest;

INLINE void measure(Largest *size, vec step, double per_unit) {
    const vec part = magnitude(step) * per_unit;
    size->most = larger(part, size->most);
    size->sum += part;
}

INLINE vec measured(const Largest *size) {
    return SELECT(is_finite(size->sum), size->most, splat(NAN));
}

/* exp([w]) R in place. */
static void turn_by(const vec *w, vec *R) {
    const vec one = splat(1.0), square = dot(w, w, 3);
    const mask small = square < splat(1e-8);
    const vec angle = root(SELECT(small, one, square));
    vec s, c, E[3][3], column[3];
    sine_cosine(angle, &s, &c);
    const vec a = SELECT(small, one - square / 6.0 * (one - square / 20.0), s / angle);
    const vec b = SELECT(small, 0.5 - square / 24.0, (one - c) / (angle * angle));
    for (int i = 0; i < 3; i++) {
        const int j = (i + 1) % 3, k = (i + 2) % 3;
        E[i][i] = one - b * w[j] * w[j] - b * w[k] * w[k];
        E[i][j] = b * w[i] * w[j] - a * w[k];
        E[i][k] = b * w[i] * w[k] + a * w[j];
    }
    for (int j = 0; j < 3; j++) {
        for (int i = 0; i < 3; i++) column[i] = R[3 * i + j];
        for (int i = 0; i < 3; i++) R[3 * i + j] = dot(E[i], column, 3);
    }
}

/* a += scale * step in the poses that go on; elsewhere it stays. */
INLINE void advance(vec *a, vec step, vec scale, mask going) {
    *a = SELECT(going, *a + step * scale, *a);
}

#endif
