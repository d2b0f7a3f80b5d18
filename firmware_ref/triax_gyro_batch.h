/* triax_gyro_batch.h - a gyro's generated routine over arrays, for the cross-check through ctypes. */
#ifndef TRIAX_GYRO_BATCH_H
#define TRIAX_GYRO_BATCH_H

#include <stddef.h>
#include <stdint.h>

/* Vectors as in triax_ref_batch_gyro, with the constants compiled in from triax_gyro_calib.h. */
void triax_gyro_batch(size_t count, const int32_t *temp_code, const int32_t *raw_code,
                      const int32_t *force, int32_t *rate, uint32_t *status);

/* The same with the constants of an image, read by triax_gyro_calib_load, whose status is returned. */
uint32_t triax_gyro_batch_image(const uint8_t *image, size_t size, size_t count,
                                const int32_t *temp_code, const int32_t *raw_code,
                                const int32_t *force, int32_t *rate, uint32_t *status);

#endif
