/* The core for any processor. */

#include "core.h"

const Core core_plain = {solve_all, differentiate_all, rows_all, "plain"};
