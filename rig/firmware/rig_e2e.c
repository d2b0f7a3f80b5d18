#include "rig_e2e.h"

#define REFLECTED_F4ACFB13 0xC8DF352FU

static uint8_t crc8_byte(uint8_t crc, uint8_t byte)
{
    unsigned value = (unsigned)crc ^ byte;
    int bit;

    for (bit = 0; bit < 8; bit++) {
        value = (value & 0x80U) != 0U ? ((value << 1) ^ 0x2FU) & 0xFFU : value << 1;
    }
    return (uint8_t)value;
}

uint8_t rig_crc8(uint16_t id, const uint8_t *payload, size_t size)
{
    uint8_t crc = 0xFFU;
    size_t i;

    crc = crc8_byte(crc, (uint8_t)(id & 0xFFU));
    crc = crc8_byte(crc, (uint8_t)(id >> 8));
    for (i = 1; i < size; i++) {
        crc = crc8_byte(crc, payload[i]);
    }
    return (uint8_t)(crc ^ 0xFFU);
}

static uint32_t crc32_byte(uint32_t crc, uint8_t byte)
{
    int bit;

    crc ^= byte;
    for (bit = 0; bit < 8; bit++) {
        crc = (crc & 1U) != 0U ? (crc >> 1) ^ REFLECTED_F4ACFB13 : crc >> 1;
    }
    return crc;
}

uint32_t rig_crc32(uint16_t id, const uint8_t *payload, size_t size)
{
    uint32_t crc = 0xFFFFFFFFU;
    size_t i;

    crc = crc32_byte(crc, (uint8_t)(id & 0xFFU));
    crc = crc32_byte(crc, (uint8_t)(id >> 8));
    for (i = 4; i < size; i++) {
        crc = crc32_byte(crc, payload[i]);
    }
    return crc ^ 0xFFFFFFFFU;
}
