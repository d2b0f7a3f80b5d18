/* accelerometer.h - compensated samples in an interrupt, temperatures and new constants outside of it. */
#ifndef ACCELEROMETER_H
#define ACCELEROMETER_H

#include "triax_comp.h"

/* Starts with the constants compiled in. */
void accelerometer_start(int32_t temp_code);

/* Outside of the interrupt: when the temperature code has changed. */
void accelerometer_set_temperature(int32_t temp_code);

/*
 * Outside of the interrupt: constants from triax_calib.bin in flash. A refused image changes nothing;
 * samples go on with the constants that were in use.
 */
uint32_t accelerometer_load(const uint8_t *file, size_t size);

/* In the data-ready interrupt. */
uint32_t accelerometer_sample(const int32_t raw_code[3], int32_t accel[3]);

#endif
