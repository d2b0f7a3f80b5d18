/* bench_angles.h - what bench_angles.c measures: the generated routine, or the same in double. */
#ifndef BENCH_ANGLES_H
#define BENCH_ANGLES_H

#include <stdint.h>

#if defined(BENCH_REAL)
#define subject_angles floating_angles
typedef int32_t subject_angle_t;
uint32_t floating_angles(const int32_t accel[3], int32_t angle[2]);
#else
#include "triax_angles.h"
#define subject_angles triax_angles
typedef triax_angle_t subject_angle_t;
#endif

#endif
