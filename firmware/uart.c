#include "uart.h"

#include <avr/interrupt.h>
#include <avr/io.h>
#include <stddef.h>
#include <util/crc16.h>

#define SLOTS 4    /* powers of two */
#define RECEIVED 16
#define SYNC_BYTES 2
#define CRC_BYTES 2
#define CRC_START 0xFFFF

#define DIVISOR (F_CPU / 8 / BAUD)
#if F_CPU % (8 * BAUD) != 0
#error "this baud rate is not possible at this clock. Use 250000, 500000 or 1000000"
#endif

struct message {
    uint16_t length;   /* without the checksum */
    bool is_frame;
    uint8_t bytes[MESSAGE_BYTES];
};

static struct message messages[SLOTS];
static volatile uint8_t first;   /* the message that goes out */
static volatile uint8_t after;   /* behind the last one */

static volatile uint8_t received[RECEIVED];
static volatile uint8_t first_received;
static volatile uint8_t after_received;

void uart_start(void)
{
    UCSR0A = _BV(U2X0);
    UCSR0C = _BV(UCSZ01) | _BV(UCSZ00); /* 8N1 */
    UBRR0 = DIVISOR - 1;
    UCSR0B = _BV(RXEN0) | _BV(TXEN0) | _BV(RXCIE0);
}

uint8_t *uart_claim(void)
{
    if ((uint8_t)(after - first) == SLOTS) {
        return NULL;
    }
    return messages[after % SLOTS].bytes;
}

static void send(uint16_t length, bool is_frame)
{
    struct message *message = &messages[after % SLOTS];
    message->length = length;
    message->is_frame = is_frame;
    after++;
    UCSR0B |= _BV(UDRIE0);
}

void uart_send_text(uint16_t length)
{
    send(length, false);
}

void uart_send_frame(uint16_t length)
{
    send(length, true);
}

/* The byte at `place` of a message; behind a frame's own bytes comes their checksum, low byte first. */
static uint8_t byte_at(const struct message *message, uint16_t place)
{
    static uint16_t crc;
    if (place == message->length) {
        return (uint8_t)crc;
    }
    if (place > message->length) {
        return crc >> 8;
    }
    const uint8_t byte = message->bytes[place];
    crc = place < SYNC_BYTES ? CRC_START : _crc_xmodem_update(crc, byte);
    return byte;
}

ISR(USART_UDRE_vect)
{
    static uint16_t place;
    if (first == after) {
        UCSR0B &= ~_BV(UDRIE0);
        return;
    }
    const struct message *message = &messages[first % SLOTS];
    UDR0 = byte_at(message, place++);
    if (place == message->length + (message->is_frame ? CRC_BYTES : 0)) {
        place = 0;
        first++;
    }
}

ISR(USART_RX_vect)
{
    const uint8_t byte = UDR0;
    if ((uint8_t)(after_received - first_received) < RECEIVED) {
        received[after_received++ % RECEIVED] = byte;
    }
}

int16_t uart_receive(void)
{
    if (first_received == after_received) {
        return -1;
    }
    return received[first_received++ % RECEIVED];
}
