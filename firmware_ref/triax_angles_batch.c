/* triax_angles_batch.c - the generated triax_angles over arrays, for the cross-check from Python. */
#include "triax_angles_batch.h"

void triax_angles_batch(const int32_t *accel, uint32_t count, triax_angle_t *angle, uint32_t *status)
{
    uint32_t i;
    for (i = 0u; i < count; i++) {
        const uint64_t row = i;
        status[row] = triax_angles(&accel[row * 3u], &angle[row * 2u]);
    }
}
