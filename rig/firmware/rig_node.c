/*
 * rig_node.c - the generated compensation as a node on the rig's bus.
 *
 * Takes RIG_TEMP, RIG_XY and RIG_Z, or RIG_FD, and answers each sample with COMP_X, COMP_Y, COMP_Z
 * of its sequence number's low byte; built with RIG_NODE_ANGLES, for a unit whose delivery has
 * triax_angles, with COMP_ANGLE_0 and COMP_ANGLE_1 behind them. Frames are packed and unpacked by the code that cantools makes
 * of tilter.dbc; frames with a wrong CRC or length are passed over.
 *
 *     rig_node socket 7    on an inherited socket that carries struct can_frame and canfd_frame
 *     rig_node can vcan0   on a CAN device
 *
 * With SAMPLES RATE behind it, the node has a sensor of its own: a file of rows of four int32, the
 * temperature code and the raw codes x, y, z, from which it takes RATE rows a second, again and again.
 * It sends RIG_TEMP, RIG_XY and RIG_Z of each, and then its answer, as a unit on the bench that
 * compensates. Then it takes no frames.
 *
 * Ends with 0 when the socket is closed, 1 when it fails, 2 for a wrong command line.
 */
#define _GNU_SOURCE
#include <errno.h>
#include <net/if.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <linux/can.h>
#include <linux/can/raw.h>

#include "rig_e2e.h"
#include "tilter.h"
#include "triax_calib.h"
#include "triax_comp.h"
#ifdef RIG_NODE_ANGLES
#include "triax_angles.h"
#endif

typedef struct {
    int socket;
    triax_state_t state;
    uint32_t temp_status;
    int has_temp;
    int has_xy;
    struct tilter_rig_xy_t xy;
} node_t;

static int send_frame(const node_t *node, uint32_t id, uint8_t payload[8])
{
    struct can_frame frame;

    payload[0] = rig_crc8((uint16_t)id, payload, 8);
    memset(&frame, 0, sizeof frame);
    frame.can_id = id;
    frame.can_dlc = 8;
    memcpy(frame.data, payload, 8);
    for (;;) {
        if (write(node->socket, &frame, sizeof frame) == (ssize_t)sizeof frame) {
            return 0;
        }
        if (errno != EINTR && errno != ENOBUFS) {
            return -1;
        }
        if (errno == ENOBUFS) {
            (void)usleep(200); /* the device's queue is full; it empties at the bus's pace */
        }
    }
}

static int answer_accel(const node_t *node, uint8_t sequence, const int32_t accel[3], uint16_t status)
{
    struct tilter_comp_x_t x = {0U, sequence, accel[0], status};
    struct tilter_comp_y_t y = {0U, sequence, accel[1], status};
    struct tilter_comp_z_t z = {0U, sequence, accel[2], status};
    uint8_t payload[8];

    (void)tilter_comp_x_pack(payload, &x, sizeof payload);
    if (send_frame(node, TILTER_COMP_X_FRAME_ID, payload) != 0) {
        return -1;
    }
    (void)tilter_comp_y_pack(payload, &y, sizeof payload);
    if (send_frame(node, TILTER_COMP_Y_FRAME_ID, payload) != 0) {
        return -1;
    }
    (void)tilter_comp_z_pack(payload, &z, sizeof payload);
    return send_frame(node, TILTER_COMP_Z_FRAME_ID, payload);
}

#ifdef RIG_NODE_ANGLES
static int answer_angles(const node_t *node, uint8_t sequence, const triax_angle_t angle[2], uint16_t status)
{
    struct tilter_comp_angle_0_t first = {0U, sequence, (uint32_t)angle[0], status};
    struct tilter_comp_angle_1_t second = {0U, sequence, (uint32_t)angle[1], status};
    uint8_t payload[8];

    (void)tilter_comp_angle_0_pack(payload, &first, sizeof payload);
    if (send_frame(node, TILTER_COMP_ANGLE_0_FRAME_ID, payload) != 0) {
        return -1;
    }
    (void)tilter_comp_angle_1_pack(payload, &second, sizeof payload);
    return send_frame(node, TILTER_COMP_ANGLE_1_FRAME_ID, payload);
}
#endif

/* All frames of a sample carry one status. */
static int answer(const node_t *node, uint8_t sequence, const int32_t accel[3], uint32_t status)
{
#ifdef RIG_NODE_ANGLES
    triax_angle_t angle[2];

    status |= triax_angles(accel, angle);
    if (answer_accel(node, sequence, accel, (uint16_t)status) != 0) {
        return -1;
    }
    return answer_angles(node, sequence, angle, (uint16_t)status);
#else
    return answer_accel(node, sequence, accel, (uint16_t)status);
#endif
}

static int take(node_t *node, const struct can_frame *frame)
{
    struct tilter_rig_temp_t temp;
    struct tilter_rig_z_t z;
    int32_t raw[3];
    int32_t accel[3];
    uint32_t status;

    if (frame->can_dlc != 8 || frame->can_id > CAN_SFF_MASK ||
        frame->data[0] != rig_crc8((uint16_t)frame->can_id, frame->data, 8)) {
        return 0;
    }
    switch (frame->can_id) {
    case TILTER_RIG_TEMP_FRAME_ID:
        (void)tilter_rig_temp_unpack(&temp, frame->data, 8);
        node->temp_status = triax_set_temperature(&node->state, &TRIAX_CALIB, temp.temp_code);
        node->has_temp = 1;
        return 0;
    case TILTER_RIG_XY_FRAME_ID:
        (void)tilter_rig_xy_unpack(&node->xy, frame->data, 8);
        node->has_xy = 1;
        return 0;
    case TILTER_RIG_Z_FRAME_ID:
        (void)tilter_rig_z_unpack(&z, frame->data, 8);
        if (!node->has_temp || !node->has_xy || node->xy.sequence != z.sequence) {
            return 0;
        }
        node->has_xy = 0;
        raw[0] = node->xy.accel_x;
        raw[1] = node->xy.accel_y;
        raw[2] = z.accel_z;
        status = triax_apply(&node->state, raw, accel);
        return answer(node, z.sequence, accel, status | node->temp_status);
    default:
        return 0;
    }
}

static int take_fd(node_t *node, const struct canfd_frame *frame)
{
    struct tilter_rig_fd_t sample;
    int32_t raw[3];
    int32_t accel[3];
    uint32_t status;

    if (frame->can_id != TILTER_RIG_FD_FRAME_ID || frame->len != TILTER_RIG_FD_LENGTH) {
        return 0;
    }
    (void)tilter_rig_fd_unpack(&sample, frame->data, TILTER_RIG_FD_LENGTH);
    if (sample.crc != rig_crc32(TILTER_RIG_FD_FRAME_ID, frame->data, TILTER_RIG_FD_LENGTH)) {
        return 0;
    }
    node->temp_status = triax_set_temperature(&node->state, &TRIAX_CALIB, sample.temp_code);
    raw[0] = sample.accel_x;
    raw[1] = sample.accel_y;
    raw[2] = sample.accel_z;
    status = triax_apply(&node->state, raw, accel);
    return answer(node, (uint8_t)(sample.sequence & 0xFFU), accel, status | node->temp_status);
}

/* One row of the sensor in the frames of the rig, and the answer to it. */
static int measure(node_t *node, const int32_t row[4], uint8_t sequence)
{
    struct tilter_rig_temp_t temp = {0U, sequence, row[0], 0U};
    struct tilter_rig_xy_t xy = {0U, sequence, row[1], row[2]};
    struct tilter_rig_z_t z = {0U, sequence, row[3], 0U, 0U};
    uint8_t payload[8];
    int32_t accel[3];
    uint32_t status;

    (void)tilter_rig_temp_pack(payload, &temp, sizeof payload);
    if (send_frame(node, TILTER_RIG_TEMP_FRAME_ID, payload) != 0) {
        return -1;
    }
    (void)tilter_rig_xy_pack(payload, &xy, sizeof payload);
    if (send_frame(node, TILTER_RIG_XY_FRAME_ID, payload) != 0) {
        return -1;
    }
    (void)tilter_rig_z_pack(payload, &z, sizeof payload);
    if (send_frame(node, TILTER_RIG_Z_FRAME_ID, payload) != 0) {
        return -1;
    }
    status = triax_set_temperature(&node->state, &TRIAX_CALIB, row[0]);
    status |= triax_apply(&node->state, &row[1], accel);
    return answer(node, sequence, accel, status);
}

/* Samples of the node's own until the socket is closed (0), or it fails (-1). */
static int run_sensor(node_t *node, FILE *samples, long rate)
{
    int32_t row[4] = {0, 0, 0, 0};
    uint8_t sequence = 0;

    for (;; sequence++) {
        if (fread(row, sizeof row, 1, samples) != 1) {
            rewind(samples);
            (void)!fread(row, sizeof row, 1, samples);
        }
        if (measure(node, row, sequence) != 0) {
            return errno == EPIPE || errno == ECONNRESET ? 0 : -1;
        }
        (void)usleep((useconds_t)(1000000 / rate));
    }
}

static int open_can(const char *device)
{
    struct sockaddr_can address;
    struct ifreq request;
    int size = 4 << 20;
    int on = 1;
    int opened = socket(PF_CAN, SOCK_RAW, CAN_RAW);

    if (opened < 0) {
        return -1;
    }
    memset(&request, 0, sizeof request);
    (void)snprintf(request.ifr_name, sizeof request.ifr_name, "%s", device);
    if (ioctl(opened, SIOCGIFINDEX, &request) != 0) {
        return -1;
    }
    memset(&address, 0, sizeof address);
    address.can_family = AF_CAN;
    address.can_ifindex = request.ifr_ifindex;
    (void)setsockopt(opened, SOL_SOCKET, SO_RCVBUFFORCE, &size, sizeof size);
    (void)setsockopt(opened, SOL_CAN_RAW, CAN_RAW_FD_FRAMES, &on, sizeof on);
    return bind(opened, (struct sockaddr *)&address, sizeof address) == 0 ? opened : -1;
}

int main(int argc, char **argv)
{
    node_t node;
    union {
        struct can_frame classic;
        struct canfd_frame fd;
    } frame;
    ssize_t size;
    int failed;
    const long rate = argc == 5 ? strtol(argv[4], NULL, 10) : 1;

    memset(&node, 0, sizeof node);
    if ((argc != 3 && argc != 5) || (strcmp(argv[1], "socket") != 0 && strcmp(argv[1], "can") != 0) ||
        rate < 1 || rate > 1000000) {
        fprintf(stderr, "rig_node: say: rig_node socket NUMBER, or rig_node can DEVICE; [SAMPLES RATE]\n");
        return 2;
    }
    node.socket = strcmp(argv[1], "can") == 0 ? open_can(argv[2]) : (int)strtol(argv[2], NULL, 10);
    if (node.socket < 0) {
        fprintf(stderr, "rig_node: %s: %s\n", argv[2], strerror(errno));
        return 1;
    }
    if (argc == 5) {
        FILE *samples = fopen(argv[3], "rb");
        (void)signal(SIGPIPE, SIG_IGN);
        if (samples == NULL || run_sensor(&node, samples, rate) != 0) {
            fprintf(stderr, "rig_node: %s: %s\n", samples == NULL ? argv[3] : argv[2], strerror(errno));
            return 1;
        }
        return 0;
    }
    for (;;) {
        size = read(node.socket, &frame, sizeof frame);
        if (size == 0) {
            return 0;
        }
        if (size < 0 && errno == EINTR) {
            continue;
        }
        failed = size < 0;
        if (size == (ssize_t)sizeof frame.classic) {
            failed = take(&node, &frame.classic);
        } else if (size == (ssize_t)sizeof frame.fd) {
            failed = take_fd(&node, &frame.fd);
        }
        if (failed != 0) {
            fprintf(stderr, "rig_node: %s: %s\n", argv[2], strerror(errno));
            return 1;
        }
    }
}
