#include "button.h"

uint8_t button_sample(button_t *button, uint8_t contact_closed)
{
    if (!contact_closed)
        button->closed = 0;
    else if (button->closed < RELEASE_SAMPLES)
        button->closed++;
    return button->closed < RELEASE_SAMPLES;
}
