/* What is asked of the core: arrays as numpy holds them, component first and pose last. */

#ifndef PKMCAL_JOB_H
#define PKMCAL_JOB_H

#include "machine.h"

typedef struct {
    const double *position, *rotation, *passive, *extension, *strain;
    int each; /* whether there is one for each pose, or one for all */
} Place;

typedef struct {
    const Machine *machine;
    long count;
    const double *parameters; /* (P, count) if `each_parameters`, or (P,) */
    int each_parameters;
    const double *series; /* where to start, as a series about home; or NULL */
    Place start;
    const double *extension; /* (n, count): a forward problem; or NULL */
    const double *target;    /* (tasks, count), or positions (3, count): an inverse problem; or NULL */
    const double *goal;      /* (9, count): the orientations that go with positions; or NULL */
    const int *place;        /* single elements to be differentiated by; or NULL */
    int places;
    double *out, *out_actuators;
} Job;

/* Rows of a solution, one after the other: position 3, rotation 9, passive, extension, strain,
   conditioning, converged, iterations. */
#define SOLUTION_ROWS(m) (3 + 9 + (m)->passives + (m)->actuators + (m)->strains + 3)

/* Numbers of a series about home. It begins with position, rotation, passive, extension, strain;
   then per output one over its unit, its linear and its quadratic coefficients. */
#define SERIES_INPUTS(m, forward) ((forward) ? (m)->actuators : 6)
#define SERIES_OUTPUTS(m, forward) ((m)->passives + ((forward) ? 6 : (m)->actuators))
#define SERIES_TERMS(n) ((n) + (n) * ((n) + 1) / 2)
#define HOME_NUMBERS(m) (12 + (m)->passives + (m)->actuators + (m)->strains)
#define SERIES_NUMBERS(m, forward) \
    (HOME_NUMBERS(m) + SERIES_OUTPUTS(m, forward) * (1 + SERIES_TERMS(SERIES_INPUTS(m, forward))))

/* 0, or -1 where there is no memory. */
typedef int (*Run)(const Job *);
typedef struct { Run solve, differentiate, rows; const char *name; } Core;

extern const Core core_plain, core_avx2;

#endif
