/* Samples into frames of the Slipstand binary protocol.
 *
 * AA 55 | version | flags | seq u32 | t_us u32 | n | n x (table i32, relative i32) | crc u16, little-endian.
 */
#pragma once

#include <stdbool.h>
#include <stdint.h>

#include "converter.h"

/* A new stream: the sequence begins at 0. `dropped` marks its first frame as coming after a loss. */
void frame_begin_stream(uint16_t rate_hz, bool dropped);

void frame_add(const struct sample *sample);

/* Send what there is of a frame. */
void frame_finish(void);

/* Whether a frame is begun and not yet finished. */
bool frame_is_open(void);
