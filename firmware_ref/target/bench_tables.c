/* bench_tables.c - TRIAX_CALIB as an object of its own, so that its size can be told. */
#include "bench_subject.h"

#define static /* what triax_calib.h defines becomes visible to the linker */
#if defined(BENCH_GYRO)
#include "triax_gyro_calib.h"
#else
#include "triax_calib.h"
#endif
