#include "frame.h"

#include <stddef.h>

#include "uart.h"

#define VERSION 1
#define DROPPED_BEFORE 0x80
#define FRAMES_PER_SECOND 200
#define MAX_SAMPLES 32

struct __attribute__((packed)) pair {
    int32_t table;
    int32_t relative;
};

struct __attribute__((packed)) frame {
    uint8_t sync[2];
    uint8_t version;
    uint8_t flags;
    uint32_t sequence;
    uint32_t time_us;
    uint8_t n;
    struct pair pairs[MAX_SAMPLES];
};

_Static_assert(sizeof(struct frame) == MESSAGE_BYTES, "a frame fills a message");

static struct frame *frame;   /* the open one; NULL while the line cannot follow, and the frame is dropped */
static uint8_t samples;       /* in the open frame, also while it is dropped */
static uint8_t full;
static bool dropped;
static uint32_t sequence;     /* of the next sample */

static uint8_t samples_per_frame(uint16_t rate_hz)
{
    const uint16_t n = rate_hz / FRAMES_PER_SECOND;
    return n < 1 ? 1 : n > MAX_SAMPLES ? MAX_SAMPLES : n;
}

void frame_begin_stream(uint16_t rate_hz, bool dropped_before)
{
    samples = 0;
    full = samples_per_frame(rate_hz);
    dropped = dropped_before;
    sequence = 0;
}

static void open(const struct sample *sample)
{
    frame = (struct frame *)uart_claim();
    if (frame == NULL) {
        dropped = true;
        return;
    }
    frame->sync[0] = 0xAA;
    frame->sync[1] = 0x55;
    frame->version = VERSION;
    frame->flags = dropped ? DROPPED_BEFORE : 0;
    frame->sequence = sequence;
    frame->time_us = sample->time_us;
    dropped = false;
}

/* Samples of a frame follow each other, so that a loss ends it early. */
static void skip(uint16_t missed)
{
    frame_finish();
    sequence += missed;
    dropped = true;
}

void frame_add(const struct sample *sample)
{
    if (sample->missed > 0) {
        skip(sample->missed);
    }
    if (samples == 0) {
        open(sample);
    }
    if (frame != NULL) {
        frame->pairs[samples].table = sample->table;
        frame->pairs[samples].relative = sample->relative;
        frame->flags |= sample->overload;
    }
    samples++;
    sequence++;
    if (samples == full) {
        frame_finish();
    }
}

void frame_finish(void)
{
    if (samples > 0 && frame != NULL) {
        frame->n = samples;
        uart_send_frame(offsetof(struct frame, pairs) + samples * sizeof(struct pair));
    }
    samples = 0;
}

bool frame_is_open(void)
{
    return samples > 0;
}
