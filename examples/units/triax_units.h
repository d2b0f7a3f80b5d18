/*
 * triax_units.h - results of triax_apply in mg, mm/s^2 and m/s^2. Include it after triax_comp.h.
 *
 * Integers are rounded to the nearest, halves away from 0. 1 g is 9.80665 m/s^2. Any int32 is legal.
 */
#ifndef TRIAX_UNITS_H
#define TRIAX_UNITS_H

#include <stdint.h>

#if !defined(TRIAX_ACCEL_Q)
#error "include triax_comp.h first"
#elif TRIAX_ACCEL_Q < 14
#error "2^31 LSB are more mm/s^2 than int32_t holds"
#endif

static inline int32_t triax_in_parts(int32_t accel, int64_t numerator, int64_t denominator)
{
    const int64_t product = accel * numerator; /* below 2^31 2^20 */
    const int64_t half = denominator / 2;
    return (int32_t)((product + ((product < 0) ? -half : half)) / denominator);
}

static inline int32_t triax_mg(int32_t accel)
{
    return triax_in_parts(accel, 1000, (int64_t)1 << TRIAX_ACCEL_Q);
}

static inline int32_t triax_mm_per_s2(int32_t accel)
{
    return triax_in_parts(accel, 980665, 100 * ((int64_t)1 << TRIAX_ACCEL_Q));
}

static inline float triax_m_per_s2(int32_t accel)
{
    return (float)accel * (9.80665f / (float)((int64_t)1 << TRIAX_ACCEL_Q));
}

#endif
