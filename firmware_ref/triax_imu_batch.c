#include "triax_imu_batch.h"

#include "triax_calib.h"
#include "triax_gyro_calib.h"
#include "triax_imu.h"

uint32_t triax_imu_batch(const uint8_t *image, size_t size, size_t count, const int32_t *temp_code,
                         const int32_t *gyro_temp_code, const int32_t *raw_accel, const int32_t *raw_gyro,
                         int32_t *accel, int32_t *rate, uint32_t *status)
{
    triax_calib_t accel_calib = TRIAX_CALIB;
    triax_gyro_calib_t gyro_calib = TRIAX_GYRO_CALIB;
    uint32_t loaded = TRIAX_STATUS_OK;
    size_t i;
    if (image != NULL) {
        loaded = triax_imu_calib_load(&accel_calib, &gyro_calib, image, size);
    }
    for (i = 0; (i < count) && (loaded == TRIAX_STATUS_OK); i++) {
        triax_imu_state_t state;
#ifdef TRIAX_IMU_TWO_THERMOMETERS
        status[i] = triax_imu_set_temperature(&state, &accel_calib, &gyro_calib, temp_code[i], gyro_temp_code[i]);
#else
        (void)gyro_temp_code;
        status[i] = triax_imu_set_temperature(&state, &accel_calib, &gyro_calib, temp_code[i]);
#endif
        status[i] |= triax_imu_apply(&state, &raw_accel[3 * i], &raw_gyro[3 * i], &accel[3 * i], &rate[3 * i]);
    }
    return loaded;
}
