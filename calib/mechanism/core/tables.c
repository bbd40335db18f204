/* From the flat tables of calib/mechanism/tables.py to a Machine; every index is checked. */

#include "tables.h"

#include <stdlib.h>
#include <string.h>

enum { HEADER = 12, LIMB_INTS = 5, ELEMENT_INTS = 5, TERM_INTS = 2 };

static int within(int value, int low, int high) { return value >= low && value < high; }

static int sized(Machine *m, const int *h) {
    m->limbs = h[1];
    m->elements = h[2];
    m->terms = h[3];
    m->parameters = h[4];
    m->actuators = h[5];
    m->passives = h[6];
    m->strains = h[7];
    m->tasks = h[8];
    m->full = h[9];
    m->redundant = h[10];
    m->independent = h[11];
    for (int k = 1; k < HEADER; k++)
        if (!within(h[k], 0, 1 << 20)) return 0;
    return m->limbs > 0 && m->actuators > 0;
}

static int read_terms(Machine *m, Limb *b, Element *e, int *term, const int *at, const double *factor) {
    for (int t = e->term; t < e->term + e->terms; t++, (*term)++) {
        Term *own = &m->term[t];
        own->kind = at[TERM_INTS * t];
        own->index = at[TERM_INTS * t + 1];
        own->factor = factor[t];
        if (!within(own->kind, 0, 3)) return 0;
        if (own->kind == PARAMETER && !within(own->index, 0, m->parameters)) return 0;
        if (own->kind == PASSIVE && !within(own->index, b->passive, b->passive + b->passives))
            return 0;
        if (own->kind != ACTUATOR) continue;
        if (!within(own->index, 0, m->actuators)) return 0;
        int known = 0;
        for (int a = 0; a < b->owns && a < 6; a++) known |= b->own[a] == own->index;
        if (known) continue;
        if (b->owns < 6) b->own[b->owns] = own->index;
        b->owns++;
    }
    return 1;
}

static int read_elements(Machine *m, Limb *b, int *moving, const int *ints, const double *reals) {
    const int *at = ints + HEADER + m->tasks + LIMB_INTS * m->limbs;
    const int *terms = at + ELEMENT_INTS * m->elements;
    const double *values = reals + 1 + m->actuators + m->passives;
    const double *factors = values + 2 * m->elements;
    int term = b->element ? m->element[b->element - 1].term + m->element[b->element - 1].terms : 0;
    b->joint = *moving;
    for (int k = b->element; k < b->element + b->elements; k++) {
        Element *e = &m->element[k];
        const int *row = at + ELEMENT_INTS * k;
        e->turns = row[0];
        e->axis = row[1];
        e->quarters = row[2];
        e->strain = row[3];
        e->term = term;
        e->terms = row[4];
        e->constant = values[2 * k];
        e->compliance = values[2 * k + 1];
        if (!within(e->axis, 0, 3) || !within(e->quarters, -1, 4)) return 0;
        if (!within(e->strain, -1, m->strains) || !within(e->terms, 0, m->terms - term + 1)) return 0;
        if (!read_terms(m, b, e, &term, terms, factors)) return 0;
        int moves = e->strain >= 0, driven = 0;
        for (int t = e->term; t < e->term + e->terms; t++) {
            moves |= m->term[t].kind != PARAMETER;
            driven |= m->term[t].kind == ACTUATOR;
        }
        b->yields += e->strain >= 0;
        b->driven += driven;
        e->joint = moves ? *moving - b->joint : -1;
        if (moves) m->moving[(*moving)++] = k;
    }
    b->joints = *moving - b->joint;
    return 1;
}

/* What moves the joints of a limb, and which of it is the first to move its unknown. */
static void find_movers(Machine *m, Limb *b, int first) {
    b->mover = first;
    for (int j = 0; j < b->joints; j++) {
        const Element *e = &m->element[m->moving[b->joint + j]];
        for (int t = e->term; t < e->term + e->terms; t++) {
            const Term *term = &m->term[t];
            int unknown = term->index - b->passive, own = 0;
            double per_unit = 1.0;
            if (term->kind == PARAMETER) continue;
            if (term->kind == PASSIVE) {
                per_unit = m->per_passive_unit[term->index];
            } else {
                while (own < 5 && own < b->owns && b->own[own] != term->index) own++;
                unknown = b->passives + own;
                per_unit = m->per_actuator_unit[term->index];
            }
            const int anew = !(b->moved >> unknown & 1);
            m->mover[first + b->movers++] = (Mover){j, unknown, anew, term->factor / per_unit};
            b->moved |= 1u << unknown;
        }
    }
}

static int read_limbs(Machine *m, const int *ints, const double *reals) {
    const int *at = ints + HEADER + m->tasks;
    int element = 0, moving = 0, mover = 0;
    for (int i = 0; i < m->limbs; i++, at += LIMB_INTS) {
        Limb *b = &m->limb[i];
        b->element = element;
        b->elements = at[0];
        b->passive = at[1];
        b->passives = at[2];
        b->released = at[3];
        b->rows = at[4];
        b->wrenches = 6 - b->passives;
        if (!within(b->elements, 0, m->elements - element + 1) || !within(b->passives, 0, 7)) return 0;
        if (!within(b->passive, 0, m->passives - b->passives + 1)) return 0;
        if (!within(b->rows, 0, b->wrenches + 1)) return 0;
        if (!read_elements(m, b, &moving, ints, reals)) return 0;
        if (b->released && b->rows < b->wrenches && b->driven != b->rows) return 0;
        if (m->independent && (b->owns != b->wrenches || b->rows != b->wrenches)) return 0;
        find_movers(m, b, mover);
        mover += b->movers;
        m->rows += b->rows;
        element += b->elements;
    }
    m->joints = moving;
    return m->rows >= 6 && element == m->elements && (!m->independent || m->rows == 6);
}

Machine *read_machine(const int *ints, size_t int_count, const double *reals, size_t real_count) {
    Machine head = {0};
    if (int_count < HEADER || ints[0] != TABLES_VERSION || !sized(&head, ints)) return NULL;
    const size_t wanted_ints = HEADER + head.tasks + (size_t)LIMB_INTS * head.limbs
        + (size_t)ELEMENT_INTS * head.elements + (size_t)TERM_INTS * head.terms;
    const size_t wanted_reals = 1 + (size_t)head.actuators + head.passives
        + 2 * (size_t)head.elements + head.terms;
    if (int_count != wanted_ints || real_count != wanted_reals) return NULL;
    const size_t limbs = head.limbs * sizeof(Limb), elements = head.elements * sizeof(Element);
    const size_t terms = head.terms * sizeof(Term), own = wanted_reals * sizeof(double);
    const size_t tasks = head.tasks * sizeof(int), moving = head.elements * sizeof(int);
    const size_t movers = head.terms * sizeof(Mover);
    char *memory =
        calloc(1, sizeof(Machine) + own + elements + terms + movers + limbs + tasks + moving + 64);
    if (!memory) return NULL;
    Machine *m = (Machine *)memory;
    *m = head;
    double *held = (double *)(memory + (sizeof(Machine) + 7) / 8 * 8);
    m->element = (Element *)((char *)held + own);
    m->term = (Term *)((char *)m->element + elements);
    m->mover = (Mover *)((char *)m->term + terms);
    m->limb = (Limb *)((char *)m->mover + movers);
    m->moving = (int *)((char *)m->limb + limbs);
    int *task = m->moving + m->elements;
    memcpy(held, reals, own);
    memcpy(task, ints + HEADER, tasks);
    m->task = task;
    m->size = held[0];
    m->per_actuator_unit = held + 1;
    m->per_passive_unit = held + 1 + m->actuators;
    for (int k = 0; k < m->tasks; k++)
        if (!within(task[k], 0, AZIMUTH + 1)) goto wrong;
    if (m->full && m->tasks != 6) goto wrong;
    if (!read_limbs(m, ints, reals)) goto wrong;
    return m;
wrong:
    free(memory);
    return NULL;
}
