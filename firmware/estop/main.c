/* Emergency-stop board: an Arduino Uno (ATmega328P, 16 MHz) that tells the host every 10 ms whether its button is
   pressed. The normally closed contact connects pin 2 (PD2) to ground; an open contact or a cut wire leaves the pin to
   its pull-up, which reads as pressed. There are no interrupts: one loop polls the timer and the serial port. */

#include <avr/io.h>
#include <avr/wdt.h>

#include "button.h"
#include "frame.h"

#define BAUD 115200UL
#define SAMPLES_PER_FRAME 10 /* of 1 ms */

/* After a reset by the watchdog it stays on, with its shortest time, and would end the start of the C program. */
void watchdog_off(void) __attribute__((naked, used, section(".init3")));
void watchdog_off(void)
{
    MCUSR = 0;
    wdt_disable();
}

static void set_up(void)
{
    DDRD &= (uint8_t)~_BV(DDD2);
    PORTD |= _BV(PORTD2); /* pull-up */
    DDRB |= _BV(DDB5);    /* the board's lamp: lit while released */

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

        pressed = button_sample(&button, !(PIND & _BV(PIND2)));
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
