/* Emergency-stop board: an Arduino Uno (ATmega328P, 16 MHz) that tells the host every 10 ms whether its button is
   pressed. Pin 5 (PD5) feeds both contacts of the button: the normally closed one leads to pin 2 (PD2), the normally
   open one to pin 3 (PD3). There are no interrupts: one loop polls the timer and the serial port. */

#include <avr/io.h>
#include <avr/wdt.h>
#include <util/delay.h>

#include "button.h"
#include "frame.h"

#define BAUD 115200UL
#define SAMPLES_PER_FRAME 10 /* of 1 ms */
#define CLOSED _BV(PIND2)    /* input of the normally closed contact, low while released */
#define OPEN _BV(PIND3)      /* of the normally open one, low while pressed */
#define FEED _BV(PIND5)
#define SETTLE_US 10 /* a metre of cable and the pull-up: 100 pF, 50 kOhm */

/* After a reset by the watchdog it stays on, with its shortest time, and would end the start of the C program. */
void watchdog_off(void) __attribute__((naked, used, section(".init3")));
void watchdog_off(void)
{
    MCUSR = 0;
    wdt_disable();
}

/* Both contacts at this level of the feed. Directions and pull-ups are written anew: none has to survive for long. */
static uint8_t contacts(uint8_t feed)
{
    DDRD = FEED;
    PORTD = (uint8_t)(CLOSED | OPEN | feed);
    _delay_us(SETTLE_US);
    return PIND & (CLOSED | OPEN);
}

/* Whether the button is out: fed low, the closed contact alone is low; fed high, as a test, both inputs follow. A wire
   that touches ground or the supply, a welded contact of a pressed button and a dead input all fail one of the two. */
static uint8_t is_out(void)
{
    uint8_t tested = contacts(FEED) == (CLOSED | OPEN);
    return contacts(0) == OPEN && tested;
}

static void set_up(void)
{
    TCCR0A = _BV(WGM01); /* counts to OCR0A: 16 MHz / 64 / 250 = 1 kHz */
    OCR0A = F_CPU / 64 / 1000 - 1;
    TCCR0B = _BV(CS01) | _BV(CS00);

    UCSR0A = _BV(U2X0);
    UBRR0 = (F_CPU / 4 / BAUD - 1) / 2; /* 16: 117.6 kBd, 2.1 % fast, as every Uno */
    UCSR0B = _BV(RXEN0) | _BV(TXEN0);
    UCSR0C = _BV(UCSZ01) | _BV(UCSZ00); /* 8 bits, no parity, 1 stop bit */

    wdt_enable(WDTO_60MS);
}

int main(void)
{
    button_t button = {0};
    uint8_t frame[FRAME_SIZE];
    uint8_t unsent = 0, samples = 0, echo = 0, pressed = 1;
    uint16_t sequence = 0;

    set_up();
    for (;;) {
        if (UCSR0A & _BV(RXC0))
            echo = UDR0;
        if (unsent && (UCSR0A & _BV(UDRE0))) {
            UDR0 = frame[FRAME_SIZE - unsent];
            unsent--;
        }
        if (!(TIFR0 & _BV(OCF0A)))
            continue;
        TIFR0 = _BV(OCF0A);
        wdt_reset(); /* here alone: a timer that stands still resets the board */

        pressed = button_sample(&button, is_out());
        DDRB = _BV(DDB5); /* the board's lamp: lit while released */
        if (pressed)
            PORTB &= (uint8_t)~_BV(PORTB5);
        else
            PORTB |= _BV(PORTB5);
        if (++samples == SAMPLES_PER_FRAME) {
            samples = 0;
            frame_write(frame, sequence++, pressed, echo);
            unsent = FRAME_SIZE;
        }
    }
}
