#ifndef PKMCAL_TABLES_H
#define PKMCAL_TABLES_H

#include <stddef.h>

#include "machine.h"

/* The machine of two tables, one block of memory to be freed; NULL where they do not fit. */
Machine *read_machine(const int *ints, size_t int_count, const double *reals, size_t real_count);

#endif
