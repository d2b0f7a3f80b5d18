/* triax_angles_batch.h - the generated triax_angles over arrays, for the cross-check from Python. */
#ifndef TRIAX_ANGLES_BATCH_H
#define TRIAX_ANGLES_BATCH_H

#include <stdint.h>

#include "triax_angles.h"

/* accel: count rows x, y, z. angle: count rows of two. */
void triax_angles_batch(const int32_t *accel, uint32_t count, triax_angle_t *angle, uint32_t *status);

#endif
