/*
 * rig_e2e.h - end-to-end protection of the rig's frames, after AUTOSAR E2E.
 *
 * A CRC runs over the 11-bit ID of the frame (low byte, high byte) and the payload without the
 * CRC's own bytes, which come first. Layout: rig/tilter.dbc.
 */
#ifndef RIG_E2E_H
#define RIG_E2E_H

#include <stddef.h>
#include <stdint.h>

/* CRC-8H2F (polynomial 0x2F, start 0xFF, inverted); payload[0] is the CRC. size >= 1. */
uint8_t rig_crc8(uint16_t id, const uint8_t *payload, size_t size);

/* CRC-32P4 (0xF4ACFB13 reflected, start 0xFFFFFFFF, inverted); payload[0..3] is the CRC.
 * size >= 4. */
uint32_t rig_crc32(uint16_t id, const uint8_t *payload, size_t size);

#endif
