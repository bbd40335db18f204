/* Jobs block by block. Included once for each kind of processor, with CORE its name. */

#include <stdlib.h>

#include "inverse.h"
#include "job.h"
#include "jacobian.h"

typedef struct {
    Work work;
    State at;
    Target target;
    DrivenWork *driven;
    vec *inverse, *unit, *out, *x, *y;
    Screw *screw;
    void *memory;
} Room;

typedef struct { uintptr_t next; } Shelf;

static void *take(Shelf *s, size_t count, size_t size) {
    void *got = (void *)s->next;
    s->next += (count * size + 31) / 32 * 32;
    return got;
}

static vec *take_vecs(Shelf *s, int count) { return take(s, (size_t)count, sizeof(vec)); }

static void take_reflectors(Shelf *s, Reflectors *q, int rows, int columns) {
    q->A = take_vecs(s, rows * columns);
    q->factor = take_vecs(s, columns);
    q->diagonal = take_vecs(s, columns);
    q->inverse = take_vecs(s, columns);
}

static void take_limb(Shelf *s, const Machine *m, const Limb *b, LimbWork *w) {
    w->screw = take(s, b->joints, sizeof(Screw));
    take_reflectors(s, &w->passive, 6, b->passives);
    w->wrench = take_vecs(s, 6 * b->wrenches);
    w->gap = take_vecs(s, 6);
    w->residual = take_vecs(s, 6);
    w->yielding = take_vecs(s, 6 * b->yields);
    w->triangle = take_vecs(s, m->redundant ? b->wrenches * b->wrenches : 0);
    take_reflectors(s, &w->driven, b->wrenches, b->released ? b->driven : 0);
    w->rest = take_vecs(s, b->joints);
    w->segment = take(s, b->joints + 1, sizeof(Segment));
}

static void take_lone(Shelf *s, const Limb *b, LoneWork *w) {
    if (!is_lone(b)) return;
    w->twist = take_vecs(s, 6 * b->joints);
    w->held = take_vecs(s, b->joints);
    w->value = take_vecs(s, 2 * b->joints);
}

/* Places everything; called once to measure and once to lay out. */
static void lay_out(Shelf *s, const Machine *m, const Job *job, Room *r, int measuring) {
    Work *w = &r->work;
    LimbWork *limbs = take(s, m->limbs, sizeof(LimbWork));
    DrivenWork *driven = take(s, m->limbs, sizeof(DrivenWork));
    LimbWork spare;
    DrivenWork spare_driven;
    LoneWork spare_lone;
    int longest = 0;
    for (int i = 0; i < m->limbs; i++) {
        const Limb *b = &m->limb[i];
        DrivenWork *d = measuring ? &spare_driven : &driven[i];
        take_limb(s, m, b, measuring ? &spare : &limbs[i]);
        take_reflectors(s, &d->q, b->wrenches, b->wrenches);
        d->twist = take_vecs(s, 6 * b->wrenches);
        d->step = take_vecs(s, b->wrenches);
        d->lone = take(s, is_lone(b), sizeof(LoneWork));
        take_lone(s, b, measuring ? &spare_lone : d->lone);
        if (b->elements > longest) longest = b->elements;
    }
    w->limb = limbs;
    r->driven = driven;
    w->parameters = take_vecs(s, m->parameters);
    take_reflectors(s, &w->platform, m->rows, 6);
    w->gap = take_vecs(s, m->rows);
    w->answer = take_vecs(s, m->rows * m->actuators);
    take_reflectors(s, &w->inner, m->tasks, m->actuators);
    w->task_answer = w->inner.A;
    w->error = take_vecs(s, m->tasks);
    w->dx = take_vecs(s, 6);
    w->ds = take_vecs(s, m->actuators);
    w->dpassive = take_vecs(s, m->passives);
    r->at.position = take_vecs(s, 3);
    r->at.rotation = take_vecs(s, 9);
    r->at.passive = take_vecs(s, m->passives);
    r->at.extension = take_vecs(s, m->actuators);
    r->at.strain = take_vecs(s, m->strains);
    r->target.value = take_vecs(s, m->tasks);
    r->inverse = take_vecs(s, 6 * m->rows);
    r->unit = take_vecs(s, m->rows);
    r->screw = take(s, longest, sizeof(Screw));
    r->x = take_vecs(s, SERIES_TERMS(m->actuators > 6 ? m->actuators : 6));
    r->y = take_vecs(s, 6 + m->passives + m->actuators);
    const int variables = m->parameters + m->actuators;
    r->out = take_vecs(s, 6 * (job->places > variables ? job->places : variables));
}

static int make_room(const Machine *m, const Job *job, Room *r) {
    Shelf shelf = {0};
    lay_out(&shelf, m, job, r, 1);
    r->memory = calloc(1, shelf.next + 32);
    if (!r->memory) return -1;
    shelf.next = ((uintptr_t)r->memory + 31) / 32 * 32;
    lay_out(&shelf, m, job, r, 0);
    return 0;
}

/* The parameters of a block, or of all, and the segments that they fix. */
static void hold_parameters(const Job *job, Room *r, long first, int n) {
    const Machine *m = job->machine;
    if (first && !job->each_parameters) return;
    for (int p = 0; p < m->parameters; p++) {
        r->work.parameters[p] = job->each_parameters
            ? load(job->parameters + p * job->count + first, n) : splat(job->parameters[p]);
    }
    for (int i = 0; i < m->limbs; i++)
        fix(m, &m->limb[i], r->work.parameters, r->work.limb[i].segment, r->work.limb[i].rest);
}

static void place_rows(const double *rows, int count, int each, long N, long first, int n, vec *out) {
    for (int k = 0; k < count; k++) out[k] = each ? load(rows + k * N + first, n) : splat(rows[k]);
}

static void place(const Job *job, const Place *from, State *at, long first, int n) {
    const Machine *m = job->machine;
    const long N = job->count;
    place_rows(from->position, 3, from->each, N, first, n, at->position);
    place_rows(from->rotation, 9, from->each, N, first, n, at->rotation);
    place_rows(from->passive, m->passives, from->each, N, first, n, at->passive);
    place_rows(from->extension, m->actuators, from->each, N, first, n, at->extension);
    place_rows(from->strain, m->strains, from->each, N, first, n, at->strain);
}

#define TOGETHER 4 /* outputs of a series that are summed side by side */

/* Outputs y of a series for inputs x (with room for their products); zero where it says nothing. */
static void sum_series(const double *numbers, int inputs, int outputs, vec *x, vec *y) {
    const double *per_unit = numbers, *linear = per_unit + outputs;
    const double *quadratic = linear + outputs * inputs;
    const int products = inputs * (inputs + 1) / 2;
    vec *product = x + inputs, first_most = splat(0.0), second_most = splat(0.0);
    int k = 0;
    for (int i = 0; i < inputs; i++) product[k++] = x[i] * x[i];
    for (int i = 0; i < inputs; i++)
        for (int j = 0; j < i; j++) product[k++] = x[i] * x[j];
    for (int o = 0; o < outputs; o += TOGETHER) {
        const double *row[TOGETHER], *square[TOGETHER];
        vec first[TOGETHER], second[TOGETHER];
        for (int a = 0; a < TOGETHER; a++) {
            const int own = o + a < outputs ? o + a : outputs - 1;
            row[a] = linear + own * inputs;
            square[a] = quadratic + own * products;
            first[a] = second[a] = splat(0.0);
        }
        for (int i = 0; i < inputs; i++)
            UNROLL for (int a = 0; a < TOGETHER; a++) first[a] += row[a][i] * x[i];
        for (int i = 0; i < products; i++)
            UNROLL for (int a = 0; a < TOGETHER; a++) second[a] += square[a][i] * product[i];
        for (int a = 0; a < TOGETHER && o + a < outputs; a++) {
            first_most = larger(magnitude(first[a]) * per_unit[o + a], first_most);
            second_most = larger(magnitude(second[a]) * per_unit[o + a], second_most);
            y[o + a] = first[a] + second[a];
        }
    }
    const mask trusted = (first_most < splat(1.0)) & (second_most < splat(0.2));
    for (int o = 0; o < outputs; o++) y[o] = SELECT(trusted & is_finite(y[o]), y[o], splat(0.0));
}

/* Start at home, moved by the series towards the extensions or the pose that stand in `at`. */
static void guess(const Job *job, Room *r) {
    const Machine *m = job->machine;
    State *at = &r->at;
    const int forward = job->extension != NULL;
    const double *home = job->series, *R = home + 3, *passive = home + 12;
    const double *extension = passive + m->passives, *strain = extension + m->actuators;
    const double *numbers = strain + m->strains;
    const int inputs = SERIES_INPUTS(m, forward), outputs = SERIES_OUTPUTS(m, forward);
    vec columns[3][3];
    if (forward) {
        for (int a = 0; a < inputs; a++) r->x[a] = at->extension[a] - extension[a];
    } else {
        for (int j = 0; j < 3; j++)
            for (int i = 0; i < 3; i++) columns[j][i] = splat(R[3 * i + j]);
        for (int i = 0; i < 3; i++) r->x[i] = (at->position[i] - home[i]) / m->size;
        small_rotation(columns, at->rotation, r->x + 3);
    }
    sum_series(numbers, inputs, outputs, r->x, r->y);
    const vec *y = forward ? r->y + 6 : r->y;
    for (int k = 0; k < m->passives; k++) at->passive[k] = passive[k] + y[k];
    for (int c = 0; c < m->strains; c++) at->strain[c] = splat(strain[c]);
    if (forward) {
        for (int i = 0; i < 3; i++) at->position[i] = home[i] + r->y[i] * m->size;
        for (int i = 0; i < 9; i++) at->rotation[i] = splat(R[i]);
        turn_by(r->y + 3, at->rotation);
    } else {
        for (int a = 0; a < m->actuators; a++) at->extension[a] = extension[a] + y[m->passives + a];
    }
}

static void aim(const Job *job, Target *to, long first, int n) {
    const Machine *m = job->machine;
    place_rows(job->target, job->goal ? 3 : m->tasks, 1, job->count, first, n, to->value);
    if (job->goal) place_rows(job->goal, 9, 1, job->count, first, n, to->goal);
    else if (m->full) rotation_of(to->value + 3, to->goal);
}

static void deliver(const Job *job, const State *at, const Progress *p, long first, int n) {
    const Machine *m = job->machine;
    const long N = job->count;
    double *row = job->out + first;
    const vec converged = SELECT(p->converged, splat(1.0), splat(0.0));
    for (int k = 0; k < 3; k++, row += N) store(row, at->position[k], n);
    for (int k = 0; k < 9; k++, row += N) store(row, at->rotation[k], n);
    for (int k = 0; k < m->passives; k++, row += N) store(row, at->passive[k], n);
    for (int k = 0; k < m->actuators; k++, row += N) store(row, at->extension[k], n);
    for (int k = 0; k < m->strains; k++, row += N) store(row, at->strain[k], n);
    store(row, p->conditioning, n);
    store(row + N, converged, n);
    store(row + 2 * N, p->iterations, n);
}

static void solve_at(const Job *job, Room *r, long first, int n) {
    const Machine *m = job->machine;
    State *at = &r->at;
    Progress p;
    if (!job->series) place(job, &job->start, at, first, n);
    if (!m->redundant)
        for (int c = 0; c < m->strains; c++) at->strain[c] = splat(0.0);
    if (job->extension)
        place_rows(job->extension, m->actuators, 1, job->count, first, n, at->extension);
    if (job->target) {
        aim(job, &r->target, first, n);
        if (m->independent) {
            for (int i = 0; i < 3; i++) at->position[i] = r->target.value[i];
            for (int i = 0; i < 9; i++) at->rotation[i] = r->target.goal[i];
        }
    }
    if (job->series) guess(job, r);
    if (job->target && m->independent) p = solve_limbs(m, &r->work, r->driven, at);
    else p = solve_block(m, &r->work, at, job->target ? &r->target : NULL);
    deliver(job, at, &p, first, n);
}

static void differentiate_at(const Job *job, Room *r, long first, int n) {
    const Machine *m = job->machine;
    const int own = job->place ? job->places : m->parameters;
    place(job, &job->start, &r->at, first, n);
    if (job->place)
        lock(m, &r->work, &r->at, r->inverse, r->unit, r->screw, job->place, own, r->out);
    else
        differentiate(m, &r->work, &r->at, r->inverse, r->unit, r->screw, r->out);
    for (long k = 0; k < 6 * own; k++) store(job->out + k * job->count + first, r->out[k], n);
    for (long k = 0; !job->place && k < 6 * m->actuators; k++)
        store(job->out_actuators + k * job->count + first, r->out[6 * own + k], n);
}

/* Rows (rows, 6, count) of the closure, then its gaps (rows, count). */
static void rows_at(const Job *job, Room *r, long first, int n) {
    const Machine *m = job->machine;
    double *gap = job->out + (long)m->rows * 6 * job->count;
    place(job, &job->start, &r->at, first, n);
    hold_platform(m, &r->work, &r->at);
    for (int k = 0; k < m->rows; k++) {
        for (int c = 0; c < 6; c++)
            store(job->out + (k * 6 + c) * job->count + first, r->work.platform.A[c * m->rows + k], n);
        store(gap + k * job->count + first, r->work.gap[k], n);
    }
}

static int each_block(const Job *job, void (*work)(const Job *, Room *, long, int)) {
    Room room;
    if (make_room(job->machine, job, &room)) return -1;
    for (long first = 0; first < job->count; first += LANES) {
        const long left = job->count - first;
        const int n = left < LANES ? (int)left : LANES;
        hold_parameters(job, &room, first, n);
        work(job, &room, first, n);
    }
    free(room.memory);
    return 0;
}

static int solve_all(const Job *job) { return each_block(job, solve_at); }
static int differentiate_all(const Job *job) { return each_block(job, differentiate_at); }
static int rows_all(const Job *job) { return each_block(job, rows_at); }
