/* The core for x86 processors with AVX2, chosen when it is loaded. Products and sums are rounded one by
   one as everywhere else: what cancels exactly on one processor does so on all. */

#if defined(__GNUC__) && defined(__x86_64__)
#define LANES 4
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#if defined(__clang__)
#pragma clang attribute push(__attribute__((target("avx2"))), apply_to = function)
#else
#pragma GCC target("avx2")
#endif
#include "core.h"

const Core core_avx2 = {solve_all, differentiate_all, rows_all, "avx2"};

#if defined(__clang__)
#pragma clang attribute pop
#endif
#else
#include "job.h"

const Core core_avx2 = {0, 0, 0, "avx2"};
#endif
