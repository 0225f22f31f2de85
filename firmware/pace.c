#include "pace.h"

#include "clock.h"

#define SECOND_US 1000000UL

void pace_start(struct pace *pace, uint32_t rate_hz)
{
    pace->step_us = SECOND_US / rate_hz;
    pace->rest = SECOND_US % rate_hz;
    pace->owed = 0;
    pace->rate_hz = rate_hz;
    pace->next_us = clock_us() + pace->step_us;
}

bool pace_is_near(const struct pace *pace, uint8_t within_us)
{
    return (int32_t)(pace->next_us - clock_us()) <= within_us;
}

static void advance(struct pace *pace)
{
    pace->due_us = pace->next_us;
    pace->next_us += pace->step_us;
    pace->owed += pace->rest;
    if (pace->owed >= pace->rate_hz) {
        pace->owed -= pace->rate_hz;
        pace->next_us++;
    }
}

uint16_t pace_due(struct pace *pace)
{
    const uint32_t now_us = clock_us();
    uint16_t steps = 0;
    while ((int32_t)(now_us - pace->next_us) >= 0) {
        advance(pace);
        steps++;
    }
    return steps;
}
