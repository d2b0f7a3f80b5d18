/* triax_batch.h - the generated routine over arrays, for the cross-check through ctypes. */
#ifndef TRIAX_BATCH_H
#define TRIAX_BATCH_H

#include <stddef.h>
#include <stdint.h>

#include "triax_comp.h"

/* Vectors as in triax_ref_batch, with the constants compiled in from triax_calib.h. */
void triax_batch(size_t count, const int32_t *temp_code, const int32_t *raw_code, int32_t *accel,
                 uint32_t *status);

/* The same with the constants of an image, read by triax_calib_load, whose status is returned. */
uint32_t triax_batch_image(const uint8_t *image, size_t size, size_t count, const int32_t *temp_code,
                           const int32_t *raw_code, int32_t *accel, uint32_t *status);

#ifdef TRIAX_RATE_Q
/*
 * With rate_code[count] for triax_set_temperature_rate; a rate of 0 goes by triax_set_temperature.
 * Constants of the image, or, with a null pointer, those of triax_calib.h.
 */
uint32_t triax_batch_rate(const uint8_t *image, size_t size, size_t count, const int32_t *temp_code,
                          const int32_t *rate_code, const int32_t *raw_code, int32_t *accel,
                          uint32_t *status);
#endif

/* Version of the compiler that built this. */
const char *triax_batch_compiler(void);

#endif
