/* Slipstand's reference firmware for Arduino Uno class boards (ATmega328P, 16 MHz).
 *
 * The main loop asks the converter for a reading as often as it can, and takes commands. Sending and
 * receiving happen in interrupts (uart.c), so that the loop never waits.
 */
#include <avr/interrupt.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include "clock.h"
#include "commands.h"
#include "converter.h"
#include "frame.h"
#include "uart.h"
#include "watchdog.h"

#define VERSION "1.0.0"
#define CHANNELS " 2\n"
#define DIGITS 6 /* of a rate, and the end of the text */

static bool is_streaming;
static bool is_asked_who;      /* an answer is owed */
static bool watchdog_bit;      /* and the host has not asked for a stream since */

static void start(bool after_loss)
{
    converter_start();
    frame_begin_stream(converter_rate_hz(), after_loss);
    is_streaming = true;
}

static void stop(void)
{
    frame_finish();
    is_streaming = false;
}

/* A stream that runs begins anew at the new rate. */
static void set_rate(uint32_t rate_hz)
{
    const bool was_streaming = is_streaming;
    if (was_streaming) {
        stop();
    }
    converter_set_rate(rate_hz); /* the host asks afterwards what has become of it */
    if (was_streaming) {
        start(false);
    }
}

static void obey(struct command command)
{
    switch (command.order) {
    case START:
        if (is_streaming) {
            stop();
        }
        start(false);
        watchdog_bit = false;
        break;
    case STOP:
        stop();
        break;
    case IDENTIFY:
        is_asked_who = true;
        break;
    case SET_RATE:
        set_rate(command.rate_hz);
        break;
    case NOTHING:
        break;
    }
}

/* One line: slipstand-fw <version>+<converter>[.watchdog] <rate> <channels> */
static void identify(void)
{
    char *text = (char *)uart_claim();
    if (text == NULL) {
        return; /* in a later round, then */
    }
    char rate[DIGITS];
    strcpy(text, "slipstand-fw " VERSION "+");
    strcat(text, converter_name);
    strcat(text, watchdog_bit ? ".watchdog " : " ");
    strcat(text, utoa(converter_rate_hz(), rate, 10));
    strcat(text, CHANNELS);
    uart_send_text(strlen(text));
    is_asked_who = false;
}

/* After a hang the stream goes on, so that only the time until now is lost. */
static void go_on(void)
{
    const uint16_t rate_hz = watchdog_cut_off_hz();
    if (rate_hz > 0 && converter_set_rate(rate_hz)) {
        start(true);
    }
}

static void run_once(void)
{
    const int16_t byte = uart_receive();
    if (byte >= 0) {
        obey(command_of(byte));
    }
    if (is_asked_who && !frame_is_open()) {
        identify();
    }
    if (is_streaming && converter_ready()) {
        struct sample sample;
        converter_read(&sample);
        frame_add(&sample);
    }
    watchdog_alive(is_streaming ? converter_rate_hz() : 0);
}

int main(void)
{
    watchdog_bit = watchdog_start();
    clock_start();
    uart_start();
    sei();
    converter_init();
    if (watchdog_bit) {
        go_on();
    }
    for (;;) {
        run_once();
    }
}
