/* bench_tables.c - TRIAX_CALIB as an object of its own, so that its size can be told. */
#include "triax_comp.h"

extern const triax_calib_t TRIAX_CALIB;
#define static /* what triax_calib.h defines becomes visible to the linker */
#include "triax_calib.h"
