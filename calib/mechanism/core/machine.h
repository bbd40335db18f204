/* A machine as flat tables: what calib/mechanism/tables.py writes, made ready for walking.

   A limb is a chain of elements. Those that move from pose to pose (passive, driven or yielding)
   are its joints here; what is fixed between two of them is one rigid segment. */

#ifndef PKMCAL_MACHINE_H
#define PKMCAL_MACHINE_H

#define TABLES_VERSION 1

enum { PARAMETER, ACTUATOR, PASSIVE };
enum { TILT = 6, AZIMUTH = 7 }; /* tasks 0..2 are x, y, z and 3..5 rx, ry, rz */

typedef struct { int kind, index; double factor; } Term;

typedef struct {
    int turns, axis;
    int quarters; /* 0..3 for a fixed rotation by quarter turns, else -1 */
    int strain;   /* row of its strain, or -1 */
    int term, terms;
    double constant, compliance;
    int joint; /* which moving element of its limb it is, or -1 */
} Element;

/* What moves a joint: `factor` times one of its limb's unknowns, each in its own unit; the passive
   coordinates come before the actuators. */
typedef struct { int joint, unknown, first; double factor; } Mover;

typedef struct {
    int element, elements;
    int passive, passives; /* first of its passive coordinates, and how many */
    int wrenches, rows, released;
    int joint, joints;     /* first of its moving elements in `moving`, and how many */
    int mover, movers;     /* first of what moves them, joint by joint, and how many */
    unsigned moved;        /* unknowns that move something, a bit each */
    int driven;            /* elements that actuators move */
    int yields;            /* elements that yield */
    int own[6], owns;      /* the actuators that move it (the first six), and how many */
} Limb;

typedef struct {
    int limbs, elements, terms, parameters, actuators, passives, strains, tasks, rows, joints;
    int redundant, independent, full;
    double size;
    const int *task;
    const double *per_actuator_unit, *per_passive_unit;
    Limb *limb;
    Element *element;
    Term *term;
    int *moving; /* elements that move, limb by limb */
    Mover *mover;
} Machine;

#endif
