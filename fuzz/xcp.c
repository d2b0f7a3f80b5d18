/*
 * libFuzzer target: packets of any content. The slave never touches memory that is not its own, never
 * answers more than a packet, and the flash always holds a calibration that the loader takes.
 *
 * Input: packets, each after a byte of its size; sizes 9 and more are operations of the main loop, and
 * from 240 on the power fails.
 */
#include <stdlib.h>
#include <string.h>

#include "triax_comp.h"
#include "triax_xcp.h"

#define SLOT_SIZE 2048u

static const uint8_t FILE_IN_FLASH[] = {FUZZ_FILE};
#define FILE_SIZE ((uint32_t)sizeof FILE_IN_FLASH)
static uint8_t *memory[2];

static uint32_t erase(void *context, uint32_t slot)
{
    (void)context;
    memset(memory[slot], 0xFF, SLOT_SIZE);
    return 0u;
}

static uint32_t program(void *context, uint32_t slot, uint32_t offset, const uint8_t *bytes, uint32_t size)
{
    (void)context;
    if (offset > SLOT_SIZE - size) {
        abort();
    }
    memcpy(&memory[slot][offset], bytes, size);
    return 0u;
}

static void sample(void *context, triax_xcp_sample_t *taken)
{
    (void)context;
    taken->count++;
}

/* The application is only ever given what its loader takes. */
static void use(void *context, const uint8_t *file)
{
    (void)context;
    if (triax_calib_check(file, FILE_SIZE) != TRIAX_STATUS_OK) {
        abort();
    }
}

static void require_calibration(const triax_store_t *store)
{
    const uint8_t *file = triax_store_file(store);
    if (file == NULL || triax_calib_check(file, FILE_SIZE) != TRIAX_STATUS_OK) {
        abort();
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    triax_store_config_t flash = {
        {NULL, NULL}, SLOT_SIZE, 8u, erase, program, NULL, triax_calib_check, FILE_SIZE,
    };
    triax_store_t store;
    triax_xcp_t xcp;
    /* Blocks of their own, for the address sanitizer. */
    uint8_t *ram = malloc(FILE_SIZE);
    const triax_xcp_config_t config = {&store, TRIAX_SHAPE, ram, "serial", "version", "epk", sample, use, NULL};
    size_t at = 0;
    int i;

    for (i = 0; i < 2; i++) {
        memory[i] = malloc(SLOT_SIZE);
        memset(memory[i], 0xFF, SLOT_SIZE);
        flash.slot[i] = memory[i];
    }
    if (triax_store_open(&store, &flash) != 0u) {
        abort();
    }
    (void)triax_store_begin(&store, FILE_IN_FLASH);
    while (triax_store_step(&store) == TRIAX_STORE_BUSY) {
    }
    triax_xcp_open(&xcp, &config);
    while (at < size) {
        const uint8_t length = data[at];
        at++;
        if (length >= 240u) {
            (void)triax_store_open(&store, &flash);
            require_calibration(&store);
            triax_xcp_open(&xcp, &config);
        } else if (length > 8u) {
            for (i = 0; i < (int)length; i++) {
                (void)triax_xcp_background(&xcp);
            }
        } else if (at + length <= size) {
            uint8_t *packet = malloc(length != 0u ? length : 1u);
            uint8_t *response = malloc(TRIAX_XCP_PACKET);
            memcpy(packet, &data[at], length);
            if (triax_xcp_receive(&xcp, packet, length, response) > TRIAX_XCP_PACKET) {
                abort();
            }
            free(packet);
            free(response);
            at += length;
        }
    }
    require_calibration(&store);
    free(ram);
    free(memory[0]);
    free(memory[1]);
    return 0;
}
