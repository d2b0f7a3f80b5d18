/* The store and the slave on a flash in memory, whose power fails at a byte. Called by ctypes. */
#include <string.h>

#include "triax_comp.h"
#include "triax_xcp.h"

#define SLOT_SIZE 1024u
#define FOREVER 0xFFFFFFFFu

static uint8_t memory[2][SLOT_SIZE];
static uint32_t left = FOREVER;
static uint32_t torn = 0x100u; /* what the byte becomes at which power fails; 0x100: it stays */
static uint32_t broken;        /* 1: erase does nothing, 2: bit 0 of the flash cannot be written */

static uint32_t change(uint32_t slot, uint32_t at, uint8_t value)
{
    if (left == 0u) {
        if (torn < 0x100u) {
            memory[slot][at] = (uint8_t)torn;
            torn = 0x100u;
        }
        return 1u;
    }
    if (left != FOREVER) {
        left--;
    }
    memory[slot][at] = value;
    return 0u;
}

static uint32_t erase(void *context, uint32_t slot)
{
    uint32_t i;
    (void)context;
    if (broken == 1u) {
        return 0u;
    }
    for (i = 0u; i < SLOT_SIZE; i++) {
        if (change(slot, i, 0xFFu) != 0u) {
            return 1u;
        }
    }
    return 0u;
}

static uint32_t program(void *context, uint32_t slot, uint32_t offset, const uint8_t *bytes, uint32_t size)
{
    uint32_t i;
    (void)context;
    if (offset % size != 0u || offset + size > SLOT_SIZE) {
        return 1u;
    }
    for (i = 0u; i < size; i++) {
        uint8_t value = bytes[i];
        if (broken == 2u) {
            value |= 1u;
        }
        if (memory[slot][offset + i] != 0xFFu || change(slot, offset + i, value) != 0u) {
            return 1u;
        }
    }
    return 0u;
}

static triax_store_config_t flash = {
    {memory[0], memory[1]}, SLOT_SIZE, 8u, erase, program, NULL, triax_calib_check, TRIAX_FILE_SIZE,
};
static triax_store_t store;
static uint8_t ram[TRIAX_FILE_SIZE];
static uint8_t used[TRIAX_FILE_SIZE];
static uint32_t samples;

static void sample(void *context, triax_xcp_sample_t *taken)
{
    (void)context;
    taken->count = ++samples;
    taken->temp_code = -2;
    taken->raw[2] = INT32_MIN;
    taken->accel[0] = INT32_MAX;
    taken->status = 4u;
}

static void use(void *context, const uint8_t *file)
{
    (void)context;
    memcpy(used, file, sizeof used);
}

static const triax_xcp_config_t config = {&store, TRIAX_SHAPE, ram, "SN 17", "fw 1.2", "EPK 17", sample, use, NULL};
static triax_xcp_t xcp;

void harness_reset(uint32_t unit)
{
    memset(memory, 0xFF, sizeof memory);
    memset(used, 0, sizeof used);
    flash.unit = unit;
    left = FOREVER;
    broken = 0u;
}

void harness_break(uint32_t how)
{
    broken = how;
}

/* Power up: what was in memory but not in flash is forgotten. */
uint32_t harness_power_up(void)
{
    const uint32_t refused = triax_store_open(&store, &flash);
    left = FOREVER;
    if (refused == 0u) {
        triax_xcp_open(&xcp, &config);
    }
    return refused;
}

uint32_t harness_store(const uint8_t *file, uint32_t stop_after, uint32_t torn_byte)
{
    left = stop_after;
    torn = torn_byte;
    (void)triax_store_begin(&store, file);
    while (triax_store_step(&store) == TRIAX_STORE_BUSY) {
    }
    return store.status;
}

uint32_t harness_in_use(uint8_t *file)
{
    if (triax_store_file(&store) != NULL) {
        memcpy(file, triax_store_file(&store), TRIAX_FILE_SIZE);
    }
    return store.active;
}

/*
 * Every position from 0: store `old`, fail while storing `wanted`, power up. Counts the outcomes in
 * found: old, new, neither, and then how often a second attempt did not bring the new one.
 * Returns the number of positions, the last of which did not fail.
 */
uint32_t harness_every_byte(const uint8_t *old, const uint8_t *wanted, uint32_t unit, uint32_t torn_byte,
                            uint32_t stores_before, uint32_t found[4])
{
    uint32_t stop;
    uint32_t i;
    uint32_t status = TRIAX_STORE_BUSY;

    for (stop = 0u; status != TRIAX_STORE_DONE; stop++) {
        harness_reset(unit);
        (void)harness_power_up();
        for (i = 0u; i < stores_before; i++) {
            (void)harness_store(old, FOREVER, 0x100u);
        }
        status = harness_store(wanted, stop, torn_byte);
        (void)harness_power_up();
        if (triax_store_file(&store) == NULL) {
            found[stores_before == 0u ? 0 : 2]++;
        } else if (memcmp(triax_store_file(&store), wanted, TRIAX_FILE_SIZE) == 0) {
            found[1]++;
        } else {
            found[memcmp(triax_store_file(&store), old, TRIAX_FILE_SIZE) == 0 ? 0 : 2]++;
        }
        if (harness_store(wanted, FOREVER, 0x100u) != TRIAX_STORE_DONE ||
            memcmp(triax_store_file(&store), wanted, TRIAX_FILE_SIZE) != 0) {
            found[3]++;
        }
    }
    return stop;
}

uint32_t harness_receive(const uint8_t *command, uint32_t size, uint8_t *response)
{
    return triax_xcp_receive(&xcp, command, size, response);
}

uint32_t harness_background(void)
{
    return triax_xcp_background(&xcp);
}

void harness_used(uint8_t *file)
{
    memcpy(file, used, sizeof used);
}
