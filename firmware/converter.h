/* The one thing the firmware knows of an analog-to-digital converter.
 *
 * hx711.c, ads1256.c, ads131m02.c and pattern.c each fill this in; the Makefile links one of them. A new converter is
 * one more such file.
 */
#pragma once

#include <stdbool.h>
#include <stdint.h>

#define OVERLOAD_TABLE 0x01    /* as in the flags byte of a frame */
#define OVERLOAD_RELATIVE 0x02

struct sample {
    int32_t table;
    int32_t relative;
    uint32_t time_us;      /* clock_us() when the reading of the table began or was fetched */
    uint16_t missed;       /* readings lost before this one, because the main loop came too late */
    uint8_t overload;      /* OVERLOAD_ bits of the channels that stand at an end of their range */
};

extern const char converter_name[];

/* Set up pins and the chip; called once. */
void converter_init(void);

/* The rate from the next start on. False, and all as before, if the converter cannot do it. */
bool converter_set_rate(uint32_t rate_hz);

uint16_t converter_rate_hz(void);

/* Begin to convert. */
void converter_start(void);

/* Called as often as the main loop can. True if a reading of both channels is ready; never waits for one. */
bool converter_ready(void);

/* Take that reading. */
void converter_read(struct sample *sample);
