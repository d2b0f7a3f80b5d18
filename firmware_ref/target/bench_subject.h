/* bench_subject.h - what bench_main.c measures: the generated routine, or a floating baseline. */
#ifndef BENCH_SUBJECT_H
#define BENCH_SUBJECT_H

#if defined(BENCH_REAL)
#include "bench_floating.h"
typedef floating_state_t subject_state_t;
typedef floating_calib_t subject_calib_t;
#define subject_set_temperature floating_set_temperature
#define subject_apply floating_apply
#define SUBJECT_CALIB (&FLOATING_CALIB)
#elif defined(BENCH_GYRO)
#include "triax_gyro_calib.h"
typedef triax_gyro_state_t subject_state_t;
typedef triax_gyro_calib_t subject_calib_t;
#define subject_set_temperature triax_gyro_set_temperature
#define subject_apply triax_gyro_apply
#define SUBJECT_CALIB (&TRIAX_GYRO_CALIB)
#else
#include "triax_calib.h"
typedef triax_state_t subject_state_t;
typedef triax_calib_t subject_calib_t;
#if defined(TRIAX_RATE_Q)
#define subject_set_temperature triax_set_temperature_rate
#else
#define subject_set_temperature triax_set_temperature
#endif
#define subject_apply triax_apply
#define SUBJECT_CALIB (&TRIAX_CALIB)
#endif

/* What a routine is given besides: dT/dt after the temperature, the force after the raw codes. */
#if defined(TRIAX_RATE_Q)
#define RATE_PARAMETER , int32_t rate
#define RATE_ARGUMENT(rate) , (rate)
#else
#define RATE_PARAMETER
#define RATE_ARGUMENT(rate)
#endif
#if defined(BENCH_GYRO)
#define FORCE_PARAMETER const int32_t force[3],
#define FORCE_ARGUMENT(force) (force),
#else
#define FORCE_PARAMETER
#define FORCE_ARGUMENT(force)
#endif

#endif
