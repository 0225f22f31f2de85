/* Equal steps of time: says when the next one is due, exact on average for every whole rate. */
#pragma once

#include <stdbool.h>
#include <stdint.h>

struct pace {
    uint32_t due_us;   /* when the latest step was due */
    uint32_t next_us;
    uint32_t step_us;
    uint32_t rest;     /* what a step is longer than step_us, in 1/rate of a microsecond */
    uint32_t owed;
    uint32_t rate_hz;
};

/* The first step is due one step from now. */
void pace_start(struct pace *pace, uint32_t rate_hz);

/* Whether the next step is due within so many microseconds, or is late. */
bool pace_is_near(const struct pace *pace, uint8_t within_us);

/* Steps that have become due since the last call: 0 mostly, 1 in time, more when called too late. */
uint16_t pace_due(struct pace *pace);
