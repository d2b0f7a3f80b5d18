/*
 * main.c - loads the calibration image from flash, rejects a damaged copy of it, and compensates
 * samples. The samples are a table here; on a board they come from the converter.
 */
#include <stddef.h>
#include <stdint.h>

#include "triax_comp.h"
#include "uart.h"

extern const uint8_t calib_image[];
extern const uint8_t calib_image_end[];

static triax_calib_t calib;
static triax_state_t state;

/* Temperature and raw codes x, y, z; the last two are out of range. */
static const struct {
    int32_t temp_code;
    int32_t raw_code[3];
} SAMPLES[] = {
    {2560, {0, 0, -1845000}},
    {-5120, {1845000, 12000, -9000}},
    {8960, {-3500, 1850000, 20}},
    {9000, {0, 0, 1845000}},
    {2560, {INT32_MAX, INT32_MIN, 0}},
};
#define SAMPLE_COUNT (sizeof SAMPLES / sizeof SAMPLES[0])

/* QEMU's way out: Arm semihosting's SYS_EXIT. Remove it on a board without a debugger. */
static void leave_emulator(void)
{
    register uint32_t operation __asm__("r0") = 0x18u;
    register uint32_t reason __asm__("r1") = 0x20026u;
    __asm__ volatile("bkpt 0xAB" : "+r"(operation) : "r"(reason) : "memory");
}

static uint32_t load_calibration(void)
{
    return triax_calib_load(&calib, calib_image, (size_t)(calib_image_end - calib_image));
}

/* What happens when one bit of the flash page is lost. */
static uint32_t load_damaged_copy(void)
{
    static uint8_t copy[TRIAX_IMAGE_SIZE];
    triax_calib_t refused;
    size_t i;
    for (i = 0u; i < sizeof copy; i++) {
        copy[i] = calib_image[i];
    }
    copy[TRIAX_IMAGE_SIZE / 2u] ^= 0x10u;
    return triax_calib_load(&refused, copy, sizeof copy);
}

static void compensate(int32_t temp_code, const int32_t raw_code[3])
{
    int32_t accel[3];
    /* A firmware calls this when the temperature has changed, and triax_apply for every sample. */
    uint32_t status = triax_set_temperature(&state, &calib, temp_code);
    uint32_t i;
    status |= triax_apply(&state, raw_code, accel);
    for (i = 0u; i < 3u; i++) {
        uart_print_decimal(accel[i]);
        uart_print(" ");
    }
    uart_print("status ");
    uart_print_decimal((int32_t)status);
    uart_print("\n");
}

int main(void)
{
    uint32_t i;
    uart_start();
    if (load_calibration() != TRIAX_STATUS_OK) {
        uart_print("calibration refused\n");
        leave_emulator();
        return 1;
    }
    uart_print("calibration loaded\n");
    uart_print((load_damaged_copy() == TRIAX_STATUS_BAD_IMAGE) ? "damaged copy refused\n"
                                                               : "DAMAGED COPY ACCEPTED\n");
    for (i = 0u; i < SAMPLE_COUNT; i++) {
        compensate(SAMPLES[i].temp_code, SAMPLES[i].raw_code);
    }
    uart_print("done\n");
    leave_emulator();
    return 0;
}
