/* bench_tables.c - The constants as an object of its own, so that its size can be told. */
#if defined(BENCH_GYRO)
#include "triax_gyro_comp.h"

extern const triax_gyro_calib_t TRIAX_GYRO_CALIB;
#define static /* what triax_gyro_calib.h defines becomes visible to the linker */
#include "triax_gyro_calib.h"
#else
#include "triax_comp.h"

extern const triax_calib_t TRIAX_CALIB;
#define static /* what triax_calib.h defines becomes visible to the linker */
#include "triax_calib.h"
#endif
