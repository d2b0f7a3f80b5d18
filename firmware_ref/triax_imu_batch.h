/* triax_imu_batch.h - both triads together over arrays, for the cross-check through ctypes. */
#ifndef TRIAX_IMU_BATCH_H
#define TRIAX_IMU_BATCH_H

#include <stddef.h>
#include <stdint.h>

/*
 * temp_code[count], gyro_temp_code[count] (used where the gyro has a thermometer of its own), raw_accel[count][3], raw_gyro[count][3] to accel[count][3], rate[count][3] and
 * status[count]. With an image its constants are used, and the status of triax_imu_calib_load is
 * returned; with a null pointer those of the headers.
 */
uint32_t triax_imu_batch(const uint8_t *image, size_t size, size_t count, const int32_t *temp_code,
                         const int32_t *gyro_temp_code, const int32_t *raw_accel, const int32_t *raw_gyro,
                         int32_t *accel, int32_t *rate, uint32_t *status);

#endif
