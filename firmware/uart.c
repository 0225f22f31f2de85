#include "uart.h"

#include <avr/interrupt.h>
#include <avr/io.h>
#include <stddef.h>
#include <util/crc16.h>

#define SLOTS 4     /* powers of two */
#define RECEIVED 16
#define SYNC_BYTES 2
#define CRC_BYTES 2
#define CRC_START 0xFFFF

#define DIVISOR (F_CPU / 8 / BAUD)
#if F_CPU % (8 * BAUD) != 0
#error "this baud rate is not possible at this clock. Use 250000, 500000 or 1000000"
#endif

struct message {
    uint16_t length;
    uint16_t unchecked; /* bytes before the checksum, which the interrupt fills in; 0 for none */
    uint8_t bytes[MESSAGE_BYTES + CRC_BYTES];
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

static void send(uint16_t length, uint16_t unchecked)
{
    struct message *message = &messages[after % SLOTS];
    message->length = length;
    message->unchecked = unchecked;
    __asm__ volatile("" ::: "memory"); /* all of it is written before the interrupt may see it */
    after++;
    UCSR0B |= _BV(UDRIE0);
}

void uart_send_text(uint16_t length)
{
    send(length, 0);
}

void uart_send_frame(uint16_t length)
{
    send(length + CRC_BYTES, length);
}

/* Every 20 us at 500000 baud, so that it has to be short. */
ISR(USART_UDRE_vect)
{
    static struct message *message = messages; /* the first one */
    static uint16_t place;
    static uint16_t crc;
    if (first == after) {
        UCSR0B &= ~_BV(UDRIE0);
        return;
    }
    const uint8_t byte = message->bytes[place++];
    UDR0 = byte;
    crc = place <= SYNC_BYTES ? CRC_START : _crc_xmodem_update(crc, byte);
    if (place == message->unchecked) {
        message->bytes[place] = (uint8_t)crc;
        message->bytes[place + 1] = crc >> 8;
    }
    if (place == message->length) {
        place = 0;
        first++;
        message = &messages[first % SLOTS];
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
