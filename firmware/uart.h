/* The serial line. All of it happens in interrupts: nothing here ever waits.
 *
 * What is sent are whole messages, in a ring of slots. The checksum of a frame is made while its bytes go
 * out, so that no reading has to wait for it.
 */
#pragma once

#include <stdbool.h>
#include <stdint.h>

#define MESSAGE_BYTES 269 /* a frame of 32 samples without its checksum */

void uart_start(void);

/* Room for the next message, MESSAGE_BYTES long; NULL while the line has not caught up. */
uint8_t *uart_claim(void);

/* Send `length` bytes of the room claimed last. */
void uart_send_text(uint16_t length);

/* The same, with CRC-16/CCITT-FALSE over all but the first two bytes after them. */
void uart_send_frame(uint16_t length);

/* The next byte that came, or -1. */
int16_t uart_receive(void);
