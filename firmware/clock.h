/* Time since the start, in microseconds, from timer 1. */
#pragma once

#include <stdint.h>

void clock_start(void);

/* Wraps after 71.6 minutes, as t_us of a frame does. */
uint32_t clock_us(void);
