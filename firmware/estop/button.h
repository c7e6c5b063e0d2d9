/* The button, from samples of its contact: pressed at once, released only after the contact has stayed closed. */
#ifndef GOLEM_ESTOP_BUTTON_H
#define GOLEM_ESTOP_BUTTON_H

#include <stdint.h>

/* Samples in a row with a closed contact that release the button: 50 ms, longer than any contact bounces, and five
   frames, so that one lost frame hides no press. */
#define RELEASE_SAMPLES 50

/* What is remembered: closed samples in a row, up to RELEASE_SAMPLES. A button that has just started is pressed. */
typedef struct {
    uint8_t closed;
} button_t;

/* Take one sample, once a millisecond: whether the contact is closed. Return whether the button is pressed. */
uint8_t button_sample(button_t *button, uint8_t contact_closed);

#endif
